"""Samples become minutes after a day, and minutes are deleted after a month, in pieces."""

import asyncio
from datetime import timedelta
from typing import Any

import pytest
from skyway_provider_registry.tables import telemetry_minutes, telemetry_samples
from skyway_provider_registry.telemetry.keep_telemetry import KeepTimes, Thinning
from skyway_provider_registry.telemetry.store import PIECE
from sqlalchemy import func, select

from skyway.runtime.clock import ManualClock
from skyway.runtime.sql.database import Database

pytestmark = pytest.mark.databases("sqlite")

KEEPING = KeepTimes(samples_for=timedelta(hours=24), minutes_for=timedelta(days=30))


@pytest.fixture
def thinning(db: Database, clock: ManualClock) -> Thinning:
    return Thinning(db, clock, KEEPING, pause_s=0.0)


async def whole_round(thinning: Thinning) -> int:
    """How many drones it went through."""
    drones = 0
    while await thinning.step():
        drones += 1
    return drones


async def kept(db: Database) -> tuple[int, int]:
    """How many samples and minutes there are."""
    async with db.read() as connection:
        counted = [
            (await connection.execute(select(func.count()).select_from(table))).scalar_one()
            for table in (telemetry_samples, telemetry_minutes)
        ]
    return counted[0], counted[1]


async def test_samples_become_minutes_with_the_same_content(
    history: Any, db: Database, clock: ManualClock, thinning: Thinning, make_sample: Any
) -> None:
    await history.keeps(
        *(make_sample(7 * number, soc=1 - number / 64, power_w=number) for number in range(30))
    )
    before = await history.shows("resolution=minute")

    clock.advance(timedelta(hours=23, minutes=59))
    await whole_round(thinning)
    early = await kept(db)
    clock.advance(timedelta(minutes=2))
    await whole_round(thinning)

    assert (early, await kept(db)) == ((30, 0), (0, 4))
    assert await history.shows() == before
    assert await history.shows("resolution=raw") == []


async def test_a_minute_is_thinned_when_all_of_it_is_old(
    history: Any, db: Database, clock: ManualClock, thinning: Thinning, make_sample: Any
) -> None:
    await history.keeps(make_sample(0), make_sample(59))
    clock.advance(timedelta(seconds=65))
    await history.keeps(make_sample(-2), make_sample(0))

    clock.advance(timedelta(hours=24) - timedelta(seconds=1))
    await whole_round(thinning)
    during = await kept(db)
    clock.advance(timedelta(seconds=2))
    await whole_round(thinning)

    assert (during, await kept(db)) == ((2, 1), (0, 2))
    shown = [item["spread"]["samples"] for item in await history.shows()]
    assert shown == [2, 2]


async def test_a_partly_thinned_period_is_shown_by_minutes(
    history: Any, clock: ManualClock, thinning: Thinning, make_sample: Any
) -> None:
    await history.keeps(make_sample(0), make_sample(1))
    clock.advance(timedelta(hours=25))
    await history.keeps(make_sample(0), make_sample(1))
    await whole_round(thinning)

    assert await history.moments() == ["2026-03-01T12:00:00Z", "2026-03-02T13:00:00Z"]
    assert await history.moments("from=2026-03-02T00:00:00Z") == [
        "2026-03-02T13:00:00Z",
        "2026-03-02T13:00:01Z",
    ]


@pytest.mark.databases("sqlite", "postgresql")
async def test_minutes_are_deleted_after_a_month(
    history: Any, db: Database, clock: ManualClock, thinning: Thinning, make_sample: Any
) -> None:
    await history.keeps(make_sample(0))
    clock.advance(timedelta(days=29))
    await history.keeps(make_sample(0))
    await whole_round(thinning)

    clock.advance(timedelta(days=1, minutes=1))
    await whole_round(thinning)

    assert await kept(db) == (0, 1)
    assert await history.moments() == ["2026-03-30T12:00:00Z"]


async def test_a_sample_of_a_thinned_minute_changes_nothing(
    history: Any, db: Database, clock: ManualClock, thinning: Thinning, make_sample: Any
) -> None:
    late = make_sample(30, soc=0.1)
    await history.keeps(make_sample(0))
    clock.advance(timedelta(hours=25))
    await whole_round(thinning)
    thinned = await history.shows()

    await history.keeps(late)
    before_it_is_old = await history.shows()
    clock.advance(timedelta(hours=25))
    await whole_round(thinning)

    assert before_it_is_old == await history.shows() == thinned
    assert await kept(db) == (0, 1)


@pytest.mark.parametrize("every_s", [1.0, 0.02])
async def test_many_samples_are_thinned_in_pieces(
    history: Any,
    db: Database,
    clock: ManualClock,
    thinning: Thinning,
    make_sample: Any,
    every_s: float,
) -> None:
    samples = 2 * PIECE + PIECE // 2
    await history.keeps(*(make_sample(every_s * number) for number in range(samples)))
    clock.advance(timedelta(hours=25))

    await whole_round(thinning)

    shown = await history.shows()
    assert (await kept(db))[0] == 0
    assert sum(item["spread"]["samples"] for item in shown) == samples
    assert len(shown) == -(-samples * every_s // 60)


async def test_replicas_thin_a_sample_once(
    history: Any, db: Database, clock: ManualClock, make_sample: Any
) -> None:
    await history.keeps(*(make_sample(5 * number) for number in range(600)))
    clock.advance(timedelta(hours=25))
    replicas = [Thinning(db, clock, KEEPING, pause_s=0.0) for _ in range(3)]

    await asyncio.gather(*(whole_round(replica) for replica in replicas))

    assert await kept(db) == (0, 50)
    assert {item["spread"]["samples"] for item in await history.shows()} == {12}


async def test_every_drone_has_its_turn_in_a_round(
    history: Any, db: Database, clock: ManualClock, thinning: Thinning, make_sample: Any
) -> None:
    drone_ids = [(await history.api.drone(history.provider_id))["drone_id"] for _ in range(3)]
    for history.drone_id in drone_ids:
        await history.keeps(make_sample())
    clock.advance(timedelta(hours=25))

    rounds = [await whole_round(thinning) for _ in range(2)]

    assert (rounds, await kept(db)) == ([3, 3], (0, 3))


async def test_the_telemetry_of_a_removed_drone_is_deleted(
    history: Any, db: Database, clock: ManualClock, thinning: Thinning, make_sample: Any
) -> None:
    await history.keeps(*(make_sample(number) for number in range(PIECE + 10)))
    clock.advance(timedelta(hours=25))
    await whole_round(thinning)
    await history.keeps(*(make_sample(number) for number in range(PIECE + 10)))
    await history.api("operator:op", "DELETE", history.path.removesuffix("/telemetry"))

    await whole_round(thinning)

    assert await kept(db) == (0, 0)
