"""The supervisor restarts children, gives up in time, and ends them all."""

import asyncio
import os
import signal
import socket
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from skyway.cli.system.supervisor import Child, ProcessKeepsDying, Supervisor, listen
from skyway.errors import SkywayError

WAITS = "import sys, time; print('up', flush=True); time.sleep(60)"


def make_child(folder: Path, program: str, name: str = "child") -> Child:
    return Child(name=name, command=(sys.executable, "-c", program), log=folder / f"{name}.log")


def niceness(pid: int | None) -> int:
    return -1 if pid is None else os.getpriority(os.PRIO_PROCESS, pid)


async def until(condition: Callable[[], object]) -> None:
    async with asyncio.timeout(20):
        while not condition():  # noqa: ASYNC110 - it asks another process
            await asyncio.sleep(0.01)


def is_running(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


async def test_a_killed_child_comes_back_as_another_process(tmp_path: Path) -> None:
    async with Supervisor() as supervisor:
        supervisor.start(make_child(tmp_path, WAITS))
        await until(lambda: supervisor.pid("child"))
        first = supervisor.pid("child")
        assert first is not None

        os.kill(first, signal.SIGKILL)

        await until(lambda: supervisor.pid("child") not in (None, first))


async def test_a_child_is_as_nice_as_requested(tmp_path: Path) -> None:
    async with Supervisor() as supervisor:
        nice = replace(make_child(tmp_path, WAITS, "nice"), gives_way_by=5)
        supervisor.start(nice)
        supervisor.start(make_child(tmp_path, WAITS, "first"))
        await until(lambda: niceness(supervisor.pid("nice")) == niceness(os.getpid()) + 5)
        first = niceness(supervisor.pid("first"))

    assert first == niceness(os.getpid())


@pytest.mark.skipif(not Path("/proc/self/autogroup").exists(), reason="Linux with autogroup only")
async def test_a_child_gives_way_to_other_sessions_too(tmp_path: Path) -> None:
    async with Supervisor() as supervisor:
        supervisor.start(replace(make_child(tmp_path, WAITS), gives_way_by=5))
        await until(lambda: supervisor.pid("child"))
        group = Path(f"/proc/{supervisor.pid('child')}/autogroup")

        await until(lambda: group.read_text().split()[-1] == str(niceness(os.getpid()) + 5))


async def test_leaving_ends_every_child(tmp_path: Path) -> None:
    async with Supervisor() as supervisor:
        for name in ("one", "two"):
            supervisor.start(make_child(tmp_path, WAITS, name))
        await until(lambda: supervisor.pid("one") and supervisor.pid("two"))
        pids = [supervisor.pid(name) or 0 for name in ("one", "two")]

    assert not any(is_running(pid) for pid in pids)


async def test_a_child_that_keeps_dying_ends_everything_and_its_log_is_named(
    tmp_path: Path,
) -> None:
    async with Supervisor() as supervisor:
        supervisor.start(make_child(tmp_path, "raise SystemExit(7)"))

        with pytest.raises(ProcessKeepsDying, match=r"child ended with code 7.*child\.log"):
            await asyncio.wait_for(supervisor.failed(), timeout=25)


async def test_a_child_that_ignores_sigterm_is_killed(tmp_path: Path) -> None:
    stubborn = f"import signal; signal.signal(signal.SIGTERM, signal.SIG_IGN); {WAITS}"
    log = tmp_path / "child.log"
    log.touch()
    async with Supervisor(leave_within_s=0.2) as supervisor:
        supervisor.start(make_child(tmp_path, stubborn))
        await until(lambda: "up" in log.read_text())
        pid = supervisor.pid("child") or 0

    assert not is_running(pid)


def test_a_taken_port_is_named_with_its_purpose() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]

        with pytest.raises(SkywayError, match=rf"port {port} for the gateway"):
            listen("127.0.0.1", port, purpose="the gateway")
