"""Fleet time, which may run faster than the wall clock."""

import asyncio
import json
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from pydantic import ValidationError

from skyway.runtime.clock import AnchoredClock, ManualClock, fleet_margin, load_clock, sleep_wall

START = datetime(2026, 3, 1, 12, tzinfo=UTC)


def test_fleet_time_runs_at_its_rate_from_the_anchor() -> None:
    wall_at = datetime.now(UTC) - timedelta(seconds=10)
    clock = AnchoredClock(fleet_at=START, wall_at=wall_at, rate=600.0)

    passed_s = (clock.now() - START).total_seconds()

    assert 6000 <= passed_s < 6000 + 60 * 600


def test_a_plain_clock_shows_wall_time() -> None:
    clock = AnchoredClock.plain()

    assert abs((clock.now() - datetime.now(UTC)).total_seconds()) < 1


def test_without_a_file_the_clock_is_plain() -> None:
    assert load_clock(None).rate == 1.0


def test_a_clock_is_read_from_its_file(tmp_path: Path) -> None:
    path = tmp_path / "clock.json"
    moments = {"fleet_at": "2026-03-01T12:00:00.000Z", "wall_at": "2026-04-01T12:00:00Z"}
    path.write_text(json.dumps({**moments, "rate": 120, "heartbeat": "ignored"}))

    clock = load_clock(path)

    assert clock == AnchoredClock(START, datetime(2026, 4, 1, 12, tzinfo=UTC), 120.0)


@pytest.mark.parametrize("rate", [0, -1])
def test_a_clock_that_does_not_run_forward_is_refused(tmp_path: Path, rate: float) -> None:
    path = tmp_path / "clock.json"
    moment = "2026-03-01T12:00:00Z"
    path.write_text(json.dumps({"fleet_at": moment, "wall_at": moment, "rate": rate}))

    with pytest.raises(ValidationError):
        load_clock(path)


async def test_sleeping_ends_when_fleet_time_is_there() -> None:
    clock = AnchoredClock(fleet_at=START, wall_at=datetime.now(UTC), rate=100_000.0)
    later = clock.now() + timedelta(hours=1)

    async with asyncio.timeout(60):
        await clock.sleep_until(later)

    assert clock.now() >= later


async def test_a_manual_clock_wakes_sleepers_in_order() -> None:
    clock = ManualClock(START)
    woken: list[int] = []

    async def sleep(after_s: int) -> None:
        await clock.sleep_until(START + timedelta(seconds=after_s))
        woken.append(after_s)

    async with asyncio.TaskGroup() as group:
        for after_s in (30, 10, 20):
            group.create_task(sleep(after_s))
        await asyncio.sleep(0)
        clock.advance(timedelta(seconds=20))
        await asyncio.sleep(0)
        early = list(woken)
        clock.advance(timedelta(seconds=10))

    assert early == [10, 20]
    assert woken == [10, 20, 30]


async def test_a_cancelled_sleeper_does_not_trouble_a_manual_clock() -> None:
    clock = ManualClock(START)
    sleeping = asyncio.create_task(clock.sleep_until(START + timedelta(seconds=1)))
    await asyncio.sleep(0)
    sleeping.cancel()
    await asyncio.gather(sleeping, return_exceptions=True)

    clock.advance(timedelta(seconds=2))

    assert clock.now() == START + timedelta(seconds=2)


async def test_a_past_moment_is_not_waited_for() -> None:
    async with asyncio.timeout(60):
        await ManualClock(START).sleep_until(START)


def test_wall_time_passes_slower_than_fast_fleet_time() -> None:
    clock = ManualClock(START, rate=60.0)

    clock.advance(timedelta(minutes=1))

    assert clock.wall_now() == START + timedelta(seconds=1)


async def test_a_span_of_wall_time_is_slept_by_the_clock() -> None:
    clock = ManualClock(START, rate=60.0)
    sleeping = asyncio.create_task(sleep_wall(clock, 2.0))
    await asyncio.sleep(0)

    clock.advance(timedelta(minutes=2))

    async with asyncio.timeout(60):
        await sleeping


@pytest.mark.parametrize(("rate", "margin_s"), [(1.0, 60.0), (600.0, 1200.0)])
def test_a_margin_is_long_enough_in_both_times(rate: float, margin_s: float) -> None:
    clock = ManualClock(START, rate=rate)

    assert fleet_margin(clock, fleet_s=60.0, wall_s=2.0) == timedelta(seconds=margin_s)
