"""The supervisor starts children again with growing pauses, and ends them all."""

import asyncio
import errno
import os
import signal
import sys
from collections.abc import AsyncIterator, Callable
from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import pytest

from skyway.cli.system.supervisor import Child, ProcessCannotRun, Supervisor
from skyway.runtime.clock import ManualClock
from skyway.runtime.errors import ExitCode

WAITS = "import sys, time; print('up', flush=True); time.sleep(60)"


def make_child(folder: Path, program: str, name: str = "child") -> Child:
    return Child(name=name, command=(sys.executable, "-c", program), log=folder / f"{name}.log")


def niceness(pid: int | None) -> int:
    return -1 if pid is None else os.getpriority(os.PRIO_PROCESS, pid)


def nicer() -> int:
    """The niceness of a child that gives way by 5; 19 is the nicest of all."""
    return min(niceness(os.getpid()) + 5, 19)


async def until(condition: Callable[[], object]) -> None:
    async with asyncio.timeout(60):
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
        await until(lambda: niceness(supervisor.pid("nice")) == nicer())
        first = niceness(supervisor.pid("first"))

    assert first == niceness(os.getpid())


@pytest.mark.skipif(not Path("/proc/self/autogroup").exists(), reason="Linux with autogroup only")
async def test_a_child_gives_way_to_other_sessions_too(tmp_path: Path) -> None:
    async with Supervisor() as supervisor:
        supervisor.start(replace(make_child(tmp_path, WAITS), gives_way_by=5))
        await until(lambda: supervisor.pid("child"))
        group = Path(f"/proc/{supervisor.pid('child')}/autogroup")

        await until(lambda: group.read_text().split()[-1] == str(nicer()))


async def test_leaving_ends_every_child(tmp_path: Path) -> None:
    async with Supervisor() as supervisor:
        for name in ("one", "two"):
            supervisor.start(make_child(tmp_path, WAITS, name))
        await until(lambda: supervisor.pid("one") and supervisor.pid("two"))
        pids = [supervisor.pid(name) or 0 for name in ("one", "two")]

    assert not any(is_running(pid) for pid in pids)


class FakeProcess:
    """A process that ends when the test says so."""

    def __init__(self, pid: int) -> None:
        self.pid = pid
        self.returncode: int | None = None
        self.has_ended = asyncio.Event()

    async def wait(self) -> int:
        await self.has_ended.wait()
        assert self.returncode is not None
        return self.returncode

    def end(self, exit_code: int) -> None:
        self.returncode = exit_code
        self.has_ended.set()

    def send_signal(self, number: int) -> None:
        self.end(-number)

    def kill(self) -> None:
        self.end(-signal.SIGKILL)


class Stage:
    """A supervisor of fake processes, on a clock of the test."""

    def __init__(self, clock: ManualClock, folder: Path) -> None:
        self.clock = clock
        self.said: list[str] = []
        self.processes: list[FakeProcess] = []
        #: The errors of the next starts.
        self.refusals: list[OSError] = []
        self.log = folder / "child.log"
        self.supervisor = Supervisor(say=self.said.append, start=self._start, clock=clock)

    async def _start(self, child: Child, parent_fd: int) -> FakeProcess:
        if self.refusals:
            raise self.refusals.pop(0)
        self.processes.append(FakeProcess(pid=100 + len(self.processes)))
        return self.processes[-1]

    async def started(self, number: int) -> FakeProcess:
        """The process of this number, once it runs."""
        await until(lambda: len(self.processes) >= number)
        return self.processes[number - 1]

    async def pause_after(self, exit_code: int, *, ran_s: float = 1.0) -> float:
        """End the running process; how many seconds pass until it is started again."""
        number = len(self.processes)
        process, waited_s = await self.started(number), 0.0
        self.clock.advance(timedelta(seconds=ran_s))
        process.end(exit_code)
        while len(self.processes) == number:
            for _ in range(5):
                await asyncio.sleep(0)
            self.clock.advance(timedelta(seconds=0.05))
            waited_s += 0.05
        return waited_s


@pytest.fixture
async def stage(clock: ManualClock, tmp_path: Path) -> AsyncIterator[Stage]:
    on_stage = Stage(clock, tmp_path)
    async with on_stage.supervisor:
        on_stage.supervisor.start(make_child(tmp_path, "not run"))
        await on_stage.started(1)
        yield on_stage


async def test_pauses_grow_while_a_child_keeps_dying_and_never_end(stage: Stage) -> None:
    pauses = [await stage.pause_after(1) for _ in range(9)]

    assert pauses == pytest.approx([0.05, 0.5, 1, 2, 4, 5, 5, 5, 5], abs=0.16)


async def test_a_child_that_had_started_well_is_started_again_immediately(stage: Stage) -> None:
    for _ in range(4):
        await stage.pause_after(1)

    assert await stage.pause_after(1, ran_s=60.0) < 0.2


async def test_each_cause_is_said_in_one_line_and_not_for_ever(stage: Stage) -> None:
    stage.refusals.append(OSError(errno.EMFILE, "Too many open files"))
    for exit_code in (-signal.SIGKILL, 3, *[1] * 8):
        await stage.pause_after(exit_code)

    causes = [line.partition("; it starts again")[0] for line in stage.said]
    assert causes[:3] == [
        "child was ended by SIGKILL",
        "child cannot be started (Too many open files)",
        "child lacks a part of the system (exit code 3)",
    ]
    assert set(causes[3:]) == {"child ended by a bug (exit code 1)"}
    assert len(stage.said) == 6  # the longest pause is said once
    assert stage.said[-1].endswith(f"it starts again in 5 s. Log: {stage.log}")


@pytest.mark.parametrize("exit_code", [ExitCode.BAD_SETTINGS, ExitCode.BAD_DATABASE])
async def test_a_cause_that_cannot_pass_ends_everything_with_the_reason(
    stage: Stage, exit_code: int
) -> None:
    stage.log.write_text("earlier\nskyway_gateway: SKYWAY_PORT: is missing\n")

    stage.processes[0].end(exit_code)

    with pytest.raises(
        ProcessCannotRun, match=r"child .*: skyway_gateway: SKYWAY_PORT.*child\.log"
    ):
        await asyncio.wait_for(stage.supervisor.failed(), timeout=60)
    assert len(stage.processes) == 1


async def test_a_child_that_ignores_sigterm_is_killed(tmp_path: Path) -> None:
    stubborn = f"import signal; signal.signal(signal.SIGTERM, signal.SIG_IGN); {WAITS}"
    log = tmp_path / "child.log"
    log.touch()
    async with Supervisor(leave_within_s=0.2) as supervisor:
        supervisor.start(make_child(tmp_path, stubborn))
        await until(lambda: "up" in log.read_text())
        pid = supervisor.pid("child") or 0

    assert not is_running(pid)
