import json
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from skyway.cli.data_folder import DataFolder
from skyway.cli.fleet_time import anchor_clock


@pytest.fixture
def folder(tmp_path: Path) -> DataFolder:
    made = DataFolder(tmp_path / "data")
    made.make()
    return made


def anchor(folder: DataFolder) -> datetime:
    return datetime.fromisoformat(json.loads(folder.clock_file.read_text())["fleet_at"])


def test_the_first_start_begins_now(folder: DataFolder) -> None:
    before = datetime.now(UTC)

    anchor_clock(folder, rate=120)

    assert before <= anchor(folder) <= datetime.now(UTC)


def test_fleet_time_never_goes_back_over_a_restart(folder: DataFolder) -> None:
    reached = datetime.now(UTC) + timedelta(days=30)
    heartbeat = {"fleet_at": reached.isoformat(), "rate": 120.0}
    folder.heartbeat_file.write_text(json.dumps(heartbeat))

    anchor_clock(folder, rate=1)

    # The clock went on for up to a heartbeat's interval after the last one.
    assert anchor(folder) >= reached + timedelta(seconds=120)


def test_two_starts_without_a_heartbeat_between_do_not_go_back(folder: DataFolder) -> None:
    anchor_clock(folder, rate=1_000)
    first = anchor(folder)

    anchor_clock(folder, rate=1_000)

    assert anchor(folder) > first
