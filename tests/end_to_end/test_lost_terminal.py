"""A closed terminal stops `skyway up` in order: nothing lives on, and the log says why."""

import fcntl
import json
import os
import subprocess
import sys
import termios
from pathlib import Path

import pytest

UP = "from skyway.cli.entry import main; main()"


def control_terminal() -> None:
    """Make standard input the terminal that controls this process, as a shell does."""
    os.setsid()
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)


def read_until(terminal: int, text: bytes) -> None:
    seen = b""
    while text not in seen:
        seen += os.read(terminal, 4096)


def started_by(pid: int) -> list[int]:
    """The processes that a process and its children have started."""
    children = [int(each) for each in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    return children + [further for each in children for further in started_by(each)]


@pytest.mark.parametrize("is_controlling", [True, False], ids=["SIGHUP", "no signal"])
@pytest.mark.long
def test_a_closed_terminal_stops_everything_in_order(
    tmp_path: Path, *, is_controlling: bool
) -> None:
    ours, theirs = os.openpty()
    arguments = ["up", "--data", str(tmp_path), "--port", "0", "--mqtt-port", "0"]
    with subprocess.Popen(
        [sys.executable, "-c", UP, *arguments],
        stdin=theirs,
        stdout=theirs,
        stderr=theirs,
        env={**os.environ, "TERM": "dumb"},
        start_new_session=not is_controlling,
        preexec_fn=control_terminal if is_controlling else None,  # noqa: PLW1509 - no threads here
    ) as up:
        os.close(theirs)
        read_until(ours, b"Stop: Ctrl-C")
        pids = started_by(up.pid)

        os.close(ours)

        assert up.wait(timeout=60) == 0
    assert len(pids) >= 4
    assert not [each for each in pids if Path(f"/proc/{each}").exists()]
    reason = "SIGHUP" if is_controlling else "the terminal is closed"
    log = (tmp_path / "logs/up.log").read_text()
    assert f"Skyway stops: {reason}." in log
    assert "nothing is left running" in log
    for name in ("registry", "composition", "gateway", "broker"):
        lines = (tmp_path / f"logs/{name}.log").read_text().splitlines()
        assert [line for line in lines if json.loads(line)["level"] == "ERROR"] == []
