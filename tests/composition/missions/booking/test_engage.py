"""An offer's drone and stations are claimed only in an unchanged world."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import pytest
from skyway_composition.calendar.commit import Snapshot
from skyway_composition.links.store import lock_links, save_link
from skyway_composition.missions.booking.store import claim_in_one_statement
from skyway_composition.networks.store import Present, lock_version
from skyway_composition.pads.store import lock_stations
from skyway_composition.tables import networks
from sqlalchemy import update

from skyway.ids import DroneId, NetworkId, ProviderId, StationId
from skyway.scheduling.trip import BookedPad
from tests.row_locks import until_a_lock_is_waited_for

pytestmark = [
    pytest.mark.parametrize("migrated_url", ["postgresql"], indirect=True),
    pytest.mark.integration,
]

DRONE, PROVIDER = DroneId("drn_1"), ProviderId("prv_1")
ROW = NetworkId("row")
BUMP = update(networks).values(conditions=networks.c.conditions + 1)


async def engage_mission(composition: Any, *, version: int = 1, calendar: int = 1) -> Any:
    async with composition.db.write() as tx:
        return await claim_in_one_statement(
            tx,
            Snapshot(Present(ROW, version, 0), {DRONE: calendar}),
            DRONE,
            PROVIDER,
            station_ids=[StationId("a")],
            now_ms=0,
        )


@asynccontextmanager
async def link_held(composition: Any) -> AsyncIterator[None]:
    """Another transaction sends the drone one more instruction, and ends with the block."""
    async with composition.db.write() as tx:
        link = (await lock_links(tx, [DRONE]))[DRONE]
        await save_link(tx, link.with_next()[0])
        yield


async def test_a_drone_without_a_link_cannot_be_claimed(composition: Any) -> None:
    assert await engage_mission(composition) is None


async def test_nothing_is_claimed_in_another_network_version(composition: Any) -> None:
    await composition.book()

    assert await engage_mission(composition, version=2) is None
    assert (await engage_mission(composition)).seq == 2


async def test_nothing_is_claimed_with_an_earlier_calendar(composition: Any) -> None:
    await composition.book()

    assert await engage_mission(composition, calendar=0) is None


async def test_a_claim_that_waited_for_a_link_gets_the_next_number(
    composition: Any,
) -> None:
    await composition.book()
    async with link_held(composition):
        engaging = asyncio.create_task(engage_mission(composition))
        await until_a_lock_is_waited_for(composition.db)

    assert (await engaging).seq == 3


async def test_a_claim_that_waited_for_a_changed_network_fails(composition: Any, make: Any) -> None:
    await composition.book()
    async with composition.db.write() as tx:
        await lock_version(tx, ROW)
        engaging = asyncio.create_task(engage_mission(composition))
        await until_a_lock_is_waited_for(composition.db)
        await tx.execute(BUMP)

    assert await engaging is None


async def test_a_claimed_station_stays_locked_until_the_transaction_ends(composition: Any) -> None:
    await composition.book()

    async def lock(*names: str) -> None:
        async with composition.db.write() as tx:
            await lock_stations(tx, [BookedPad(StationId(name), 0, 0, 1) for name in names])

    async with composition.db.write() as tx:
        await claim_in_one_statement(
            tx,
            Snapshot(Present(ROW, 1, 0), {DRONE: 1}),
            DRONE,
            PROVIDER,
            station_ids=[StationId("a")],
            now_ms=0,
        )
        await lock("b")
        waiting = asyncio.create_task(lock("a"))
        await until_a_lock_is_waited_for(composition.db)
        assert not waiting.done()
    await waiting
