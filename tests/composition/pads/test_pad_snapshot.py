"""The reservations that planning reads: with the gap before them, and with outages."""

import asyncio
from typing import Any

import numpy as np
import pytest
from skyway_composition.pads.pad_snapshot import PadSnapshot

from skyway.ids import StationId
from skyway.planner.pad_book import OPEN_MS
from skyway.scheduling.trip import BookedPad

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)


async def make_snapshot(composition: Any, **members: Any) -> PadSnapshot:
    skyway = await composition.parts.networks.current("row")
    pads = PadSnapshot(composition.db, skyway.network_id, skyway.network, after_ms=0, **members)
    await pads.read(np.arange(5, dtype=np.int32))
    return pads


async def test_reservations_begin_a_gap_early(composition: Any) -> None:
    await composition.book()

    exact = await make_snapshot(composition)
    with_gap = await make_snapshot(composition, gap_ms=120_000)

    assert len(exact.book.start_ms) > 0
    assert (with_gap.book.start_ms == exact.book.start_ms - 120_000).all()
    assert (with_gap.book.end_ms == exact.book.end_ms).all()


async def test_outages_count_before_any_station_is_read(composition: Any) -> None:
    skyway = await composition.parts.networks.current("row")

    pads = PadSnapshot(
        composition.db,
        skyway.network_id,
        skyway.network,
        after_ms=0,
        outages=[
            (StationId("b"), 1, 10, OPEN_MS),
            (StationId("b"), 2, 10, 20),
            (StationId("z"), 0, 10, 20),
        ],
    )

    # Pad 2 and station z do not exist in this version.
    assert pads.book.station.tolist() == [1]
    assert (pads.book.pad.tolist(), pads.book.start_ms.tolist()) == ([1], [10])


async def test_an_outage_still_counts_after_stations_are_read(composition: Any) -> None:
    pads = await make_snapshot(composition, outages=[("b", 1, 10, 20)])

    assert pads.book.end_ms.tolist() == [20]


async def test_a_second_reader_waits_for_the_first(composition: Any) -> None:
    """A quote plans for all providers at the same time, in one world."""
    await composition.book()
    skyway = await composition.parts.networks.current("row")
    pads = PadSnapshot(composition.db, skyway.network_id, skyway.network, after_ms=0)

    async def known_after_reading() -> int:
        await pads.read(np.arange(5, dtype=np.int32))
        return len(pads.book.start_ms)

    first, second = await asyncio.gather(known_after_reading(), known_after_reading())

    assert (first > 0, second) == (True, first)


async def test_a_mission_counts_as_if_it_had_other_pads(composition: Any) -> None:
    booking = await composition.book()
    mission_id = booking.missions[0].mission_id
    pad = BookedPad(StationId("d"), 1, 1_000, 2_000)
    pads = await make_snapshot(composition)

    moved = pads.instead({mission_id: [pad]})
    await moved.read(np.arange(5, dtype=np.int32))

    assert moved.book.station.tolist() == [3]
    gone = moved.without([mission_id])
    await gone.read(np.arange(5, dtype=np.int32))
    assert gone.book.station.tolist() == []


async def test_the_holders_of_pads_in_some_time_are_known(composition: Any, make: Any) -> None:
    await composition.publish(make.network(pads=dict.fromkeys("abcde", 1)))
    booking = await composition.book()
    held = await composition.reservations()
    first_ms, last_ms = min(each.start_ms for each in held), max(each.end_ms for each in held)
    pads = await make_snapshot(composition)

    during = pads.holders(from_ms=first_ms, until_ms=last_ms)
    after = pads.holders(from_ms=last_ms, until_ms=last_ms + 1)

    assert during == frozenset([booking.missions[0].mission_id])
    assert not after


async def test_a_station_with_a_free_pad_keeps_nobody_waiting(composition: Any) -> None:
    await composition.book()
    pads = await make_snapshot(composition)
    with_outages = await make_snapshot(
        composition, outages=[(StationId(each), 1, 0, OPEN_MS) for each in "abcde"]
    )

    assert not pads.holders(from_ms=0, until_ms=OPEN_MS)
    assert with_outages.holders(from_ms=0, until_ms=OPEN_MS)
