"""Fleet time over restarts: it never goes back, and runs on while the system is stopped."""

import asyncio
import json
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from skyway.cli.data_folder import DataFolder
from skyway.cli.system.fleet_time import anchor_clock, keep_heartbeat, rate_for
from skyway.runtime.clock import load_clock


@pytest.fixture
def folder(tmp_path: Path) -> DataFolder:
    made = DataFolder(tmp_path / "data")
    made.make()
    return made


def anchor(folder: DataFolder) -> datetime:
    return load_clock(folder.clock_file).fleet_at


def note_heartbeat(
    folder: DataFolder, fleet_at: datetime, *, rate: float, ago: timedelta
) -> datetime:
    """Write the last heartbeat of a supervisor, `ago` before now; return its wall time."""
    wall_at = datetime.now(UTC) - ago
    heartbeat = {"fleet_at": fleet_at.isoformat(), "wall_at": wall_at.isoformat(), "rate": rate}
    folder.heartbeat_file.write_text(json.dumps(heartbeat))
    return wall_at


def in_a_month() -> datetime:
    return datetime.now(UTC) + timedelta(days=30)


def test_the_first_start_begins_now(folder: DataFolder) -> None:
    before = datetime.now(UTC)

    anchor_clock(folder, rate=120)

    assert before <= anchor(folder) <= datetime.now(UTC)


def test_fleet_time_never_goes_back_over_a_restart(folder: DataFolder) -> None:
    reached = in_a_month()
    note_heartbeat(folder, reached, rate=120.0, ago=timedelta())

    anchor_clock(folder, rate=1)

    # The clock went on for up to a heartbeat's interval after the last one.
    assert anchor(folder) >= reached + timedelta(seconds=120)


def test_fleet_time_runs_on_while_the_system_is_stopped(folder: DataFolder) -> None:
    reached = in_a_month()
    noted_at = note_heartbeat(folder, reached, rate=120.0, ago=timedelta(seconds=40))

    anchor_clock(folder, rate=120)

    started = load_clock(folder.clock_file)
    # A drone that flew on by the old anchor is neither ahead of the new one nor behind it.
    assert started.fleet_at == reached + (started.wall_at - noted_at) * 120


def test_fleet_time_of_a_long_unused_folder_runs_on_for_a_day_only(
    folder: DataFolder,
) -> None:
    reached = in_a_month()
    note_heartbeat(folder, reached, rate=100_000.0, ago=timedelta(days=365))

    anchor_clock(folder, rate=100_000)

    assert anchor(folder) == reached + timedelta(days=100_000)


def test_a_machine_clock_that_was_set_back_does_not_set_fleet_time_back(
    folder: DataFolder,
) -> None:
    reached = in_a_month()
    note_heartbeat(folder, reached, rate=120.0, ago=timedelta(hours=-1))

    anchor_clock(folder, rate=120)

    assert anchor(folder) >= reached + timedelta(seconds=120)


def test_a_slower_clock_starts_later_than_any_drone_can_be(folder: DataFolder) -> None:
    reached = in_a_month()
    noted_at = note_heartbeat(folder, reached, rate=120.0, ago=timedelta(seconds=40))

    anchor_clock(folder, rate=20)

    started = load_clock(folder.clock_file)
    last_seen_at = started.wall_at + timedelta(seconds=59)
    on_board = reached + (last_seen_at - noted_at) * 120
    assert started.fleet_at + (last_seen_at - started.wall_at) * 20 >= on_board


def test_two_starts_without_a_heartbeat_between_do_not_go_back(folder: DataFolder) -> None:
    anchor_clock(folder, rate=1_000)
    first = anchor(folder)

    anchor_clock(folder, rate=1_000)

    assert anchor(folder) > first


async def test_a_heartbeat_stores_the_time_of_the_anchored_clock(folder: DataFolder) -> None:
    anchor_clock(folder, rate=120)
    started = load_clock(folder.clock_file)
    at_the_start = folder.heartbeat_file.read_text()

    beating = asyncio.ensure_future(keep_heartbeat(folder))
    await asyncio.sleep(0)
    beating.cancel()

    noted = load_clock(folder.heartbeat_file)
    assert folder.heartbeat_file.read_text() != at_the_start
    assert noted.fleet_at == started.fleet_at + (noted.wall_at - started.wall_at) * 120


@pytest.mark.parametrize(
    ("speed", "rate"), [(0.0, 15), (0.24, 15), (0.25, 30), (0.49, 30), (0.5, 60), (9.0, 60)]
)
def test_time_runs_slower_in_the_small_world_of_a_slow_machine(speed: float, rate: float) -> None:
    assert rate_for(speed) == rate
