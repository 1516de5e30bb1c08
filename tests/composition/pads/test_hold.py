"""`hold` gives a mission exactly the named pads, and no pad that another mission holds."""

from typing import Any

import pytest
from skyway_composition.pads.store import hold

from skyway.ids import MissionId, StationId
from skyway.runtime.errors import RowRefused
from skyway.scheduling.trip import BookedPad

pytestmark = pytest.mark.databases("sqlite")


def pad(station: str, number: int, start_ms: int, end_ms: int) -> BookedPad:
    return BookedPad(StationId(station), number, start_ms, end_ms)


async def two_missions(composition: Any, make: Any) -> tuple[MissionId, MissionId]:
    """Two live missions without reservations."""
    booked = [
        await composition.book(make.candidate(number), delivery_id=f"dlv_{number}")
        for number in (1, 2)
    ]
    ids = [booking.missions[0].mission_id for booking in booked]
    async with composition.db.write() as tx:
        for mission_id in ids:
            await hold(tx, mission_id, [])
    assert await composition.reservations() == []
    return ids[0], ids[1]


async def held(composition: Any) -> list[tuple[Any, ...]]:
    return [tuple(row)[:4] for row in await composition.reservations()]


async def test_a_pad_that_is_no_longer_needed_is_free(composition: Any, make: Any) -> None:
    first, second = await two_missions(composition, make)
    async with composition.db.write() as tx:
        await hold(tx, first, [pad("b", 0, 0, 100), pad("c", 1, 0, 50)])

    async with composition.db.write() as tx:
        await hold(tx, first, [pad("b", 0, 0, 40)])
    async with composition.db.write() as tx:
        await hold(tx, second, [pad("b", 0, 40, 100), pad("c", 1, 0, 50)])

    assert await held(composition) == [("b", 0, 0, 40), ("b", 0, 40, 100), ("c", 1, 0, 50)]


async def test_overlapping_sessions_of_one_mission_become_one(composition: Any, make: Any) -> None:
    first, _ = await two_missions(composition, make)

    async with composition.db.write() as tx:
        await hold(tx, first, [pad("b", 0, 50, 150), pad("b", 0, 0, 100)])

    assert await held(composition) == [("b", 0, 0, 150)]


async def test_a_session_may_be_extended(composition: Any, make: Any) -> None:
    first, _ = await two_missions(composition, make)
    async with composition.db.write() as tx:
        await hold(tx, first, [pad("b", 0, 0, 100)])

    async with composition.db.write() as tx:
        await hold(tx, first, [pad("b", 0, 50, 200)])

    assert await held(composition) == [("b", 0, 50, 200)]


async def test_a_pad_of_another_mission_is_refused_and_nothing_changes(
    composition: Any, make: Any
) -> None:
    first, second = await two_missions(composition, make)
    async with composition.db.write() as tx:
        await hold(tx, first, [pad("b", 0, 0, 100)])
        await hold(tx, second, [pad("c", 0, 0, 100)])

    with pytest.raises(RowRefused):
        async with composition.db.write() as tx:
            await hold(tx, second, [pad("b", 0, 99, 150)])

    assert await held(composition) == [("b", 0, 0, 100), ("c", 0, 0, 100)]
