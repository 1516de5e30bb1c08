"""The agent as a process."""

import json
import logging
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from skyway_drone_agent.__main__ import News

from tests.long_cases import sampled

COMMAND = [sys.executable, "-m", "skyway_drone_agent"]


@pytest.fixture(params=sampled([2, 1], every=2), ids=["a fleet", "a drone"])
def files(request: pytest.FixtureRequest, tmp_path: Path, drone: Any) -> list[str]:
    """Arguments for drones whose broker nobody serves; a fleet has another event loop."""
    drones = [
        drone.model_copy(update={"drone_id": f"drn_{number + 1}"})
        for number in range(request.param)
    ]
    fleet = tmp_path / "fleet.json"
    fleet.write_text(json.dumps([one.model_dump(mode="json") for one in drones]))
    journal = str(tmp_path / "journal")
    return ["--fleet", str(fleet), "--journal", journal, "--mqtt-url", "mqtt://127.0.0.1:9"]


@pytest.fixture
def pipe() -> Iterator[tuple[int, int]]:
    ends = os.pipe()
    yield ends
    for end in ends:
        try:
            os.close(end)
        except OSError:
            continue


def wait_for_journal(tmp_path: Path, running: subprocess.Popen[str]) -> None:
    assert running.stderr is not None
    for line in running.stderr:
        if "no connection to the broker" in line:
            break
    assert (tmp_path / "journal" / "drn_1.jsonl").exists()


def test_a_missing_broker_is_named_and_ends_the_process(files: list[str]) -> None:
    done = subprocess.run(
        [*COMMAND, *files[: files.index("--mqtt-url")]],
        capture_output=True,
        text=True,
        env={key: value for key, value in os.environ.items() if key != "SKYWAY_MQTT_URL"},
        check=False,
        timeout=60,
    )

    assert done.returncode == 2
    assert "--mqtt-url or SKYWAY_MQTT_URL" in done.stderr
    assert "drn_1 names none" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_the_log_goes_to_a_file_and_the_terminal_stays_quiet(
    tmp_path: Path, files: list[str]
) -> None:
    log = tmp_path / "fleet.log"
    environment = {**os.environ, "SKYWAY_AGENT_LOG": str(log)}
    with subprocess.Popen(
        [*COMMAND, *files], stderr=subprocess.PIPE, text=True, env=environment
    ) as running:
        while not (log.exists() and "no connection to the broker" in log.read_text()):
            assert running.poll() is None
        running.send_signal(signal.SIGTERM)
        _, said = running.communicate(timeout=60)

    assert (running.returncode, said) == (0, "")
    assert all(json.loads(line) for line in log.read_text().splitlines())


def test_the_line_of_a_minute_counts_what_happened() -> None:
    news, log = News(), logging.getLogger("a fleet")
    log.addHandler(news)
    for kind in ("STEP_ENDED", "STEP_ENDED", "MISSION_ENDED"):
        log.warning("drone event", extra={"event_kind": kind})

    assert news.line(10)[5:] == (
        " 10 drones: 1 x drone event MISSION_ENDED, 2 x drone event STEP_ENDED\n"
    )
    assert news.line(10)[5:] == " 10 drones: nothing new\n"


def test_the_agent_stops_when_its_terminal_is_closed(files: list[str]) -> None:
    ours, theirs = os.openpty()
    with subprocess.Popen(
        [*COMMAND, *files], stdin=theirs, stdout=theirs, stderr=theirs, start_new_session=True
    ) as running:
        os.close(theirs)
        seen = b""
        while b"no connection to the broker" not in seen:
            seen += os.read(ours, 4096)

        os.close(ours)

        assert running.wait(timeout=60) == 0


def test_an_agent_under_nohup_outlives_its_terminal(tmp_path: Path, files: list[str]) -> None:
    command = ["nohup", *COMMAND, *files]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as running:
        wait_for_journal(tmp_path, running)
        running.send_signal(signal.SIGHUP)
        running.send_signal(signal.SIGTERM)

        assert running.stderr is not None
        stops = [json.loads(line) for line in running.stderr if "asked to stop" in line]
        assert running.wait(timeout=60) == 0
    assert [each["reason"] for each in stops] == ["SIGTERM"]


def test_the_agent_stops_when_its_parent_exits(
    tmp_path: Path, files: list[str], pipe: tuple[int, int]
) -> None:
    ours, theirs = pipe[1], pipe[0]
    with subprocess.Popen(
        [*COMMAND, *files],
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "SKYWAY_PARENT_FD": str(theirs)},
        pass_fds=[theirs],
    ) as running:
        wait_for_journal(tmp_path, running)
        os.close(ours)

        assert running.wait(timeout=60) == 0
