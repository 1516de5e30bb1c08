"""The fleet clock as the cloud sets it."""

import asyncio
from datetime import UTC, datetime, timedelta
from pathlib import Path

from skyway_drone_agent.clock_keeper import KeptClock

from skyway.contracts.world import ClockAnchor

NOON = datetime(2026, 3, 1, 12, tzinfo=UTC)


def anchor(rate: float, fleet_at: datetime = NOON) -> ClockAnchor:
    return ClockAnchor(
        message_id="msg_1", sent_at=NOON, fleet_at=fleet_at, wall_at=datetime.now(UTC), rate=rate
    )


async def test_fleet_time_is_not_set_without_the_clouds_anchor(tmp_path: Path) -> None:
    waiting = asyncio.ensure_future(KeptClock(tmp_path / "clock.json").wait_until_set())

    done, _ = await asyncio.wait([waiting], timeout=0.02)

    assert not done
    waiting.cancel()


async def test_fleet_time_is_the_anchors(tmp_path: Path) -> None:
    clock = KeptClock(tmp_path / "clock.json")

    clock.keep(anchor(rate=600.0))

    await clock.wait_until_set()
    assert clock.rate == 600.0
    assert NOON <= clock.now() < NOON + timedelta(hours=1)


async def test_after_a_restart_without_the_cloud_the_kept_anchor_counts(tmp_path: Path) -> None:
    KeptClock(tmp_path / "clock.json").keep(anchor(rate=60.0))

    restarted = KeptClock(tmp_path / "clock.json", wait_s=0.01)
    await restarted.wait_until_set()

    assert restarted.rate == 60.0
    assert NOON <= restarted.now() < NOON + timedelta(hours=1)


async def test_the_clouds_anchor_is_used_before_the_kept_one(tmp_path: Path) -> None:
    KeptClock(tmp_path / "clock.json").keep(anchor(rate=60.0))

    restarted = KeptClock(tmp_path / "clock.json", wait_s=60.0)
    waiting = asyncio.ensure_future(restarted.wait_until_set())
    await asyncio.sleep(0)
    restarted.keep(anchor(rate=1.0, fleet_at=NOON + timedelta(days=1)))
    await waiting

    assert restarted.rate == 1.0
    assert restarted.now() >= NOON + timedelta(days=1)


async def test_a_new_anchor_wakes_sleepers_whose_moment_has_passed(tmp_path: Path) -> None:
    clock = KeptClock(tmp_path / "clock.json")
    clock.keep(anchor(rate=1.0))
    sleeping = asyncio.ensure_future(clock.sleep_until(NOON + timedelta(hours=5)))
    await asyncio.sleep(0)

    clock.keep(anchor(rate=1.0, fleet_at=NOON + timedelta(hours=6)))

    await asyncio.wait_for(sleeping, timeout=60)


async def test_a_clock_ahead_of_a_new_anchor_runs_slower_until_the_cloud_catches_up(
    tmp_path: Path,
) -> None:
    clock = KeptClock(tmp_path / "clock.json")
    clock.keep(anchor(rate=600.0, fleet_at=NOON + timedelta(hours=5)))
    reached = clock.now()

    clock.keep(anchor(rate=20.0))

    assert clock.now() >= reached
    # It does not stand still meanwhile: a heartbeat that is due by the wall clock is sent.
    assert 0 < clock.rate < 20.0
    await asyncio.wait_for(clock.sleep_until(clock.now() + timedelta(seconds=0.2)), timeout=60)


async def test_a_clock_that_was_ahead_follows_the_cloud_again(tmp_path: Path) -> None:
    clock = KeptClock(tmp_path / "clock.json")
    clock.keep(anchor(rate=600.0, fleet_at=NOON + timedelta(seconds=30)))
    received = anchor(rate=600.0)

    clock.keep(received)
    # It catches up after 60 s of fleet time, a tenth of a second.
    await asyncio.wait_for(clock.sleep_until(NOON + timedelta(seconds=90)), timeout=60)

    assert clock.rate == 600.0
    before = clock.wall_now()
    assert clock.now() >= received.fleet_at + (before - received.wall_at) * 600.0
    assert clock.now() <= received.fleet_at + (clock.wall_now() - received.wall_at) * 600.0


async def test_a_full_disk_does_not_stop_the_clock(tmp_path: Path) -> None:
    clock = KeptClock(tmp_path / "no_such_folder" / "clock.json")

    clock.keep(anchor(rate=600.0))

    await clock.wait_until_set()
    assert clock.rate == 600.0
