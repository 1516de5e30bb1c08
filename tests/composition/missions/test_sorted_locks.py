"""Transactions lock several rows in sorted order, so that no two of them wait for each other.

In each test another transaction holds the first of several rows. A transaction that locks in sorted
order waits there, and holds none of the others yet.
"""

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import replace
from typing import Any

import pytest
from skyway_composition.calendar.commit import Snapshot
from skyway_composition.links.store import lock_links, lock_or_add_links
from skyway_composition.missions.booking.hold_store import free_drones
from skyway_composition.missions.booking.store import claim_in_one_statement
from skyway_composition.missions.mission.store import lock_live
from skyway_composition.networks.store import Present
from skyway_composition.pads.store import lock_stations
from sqlalchemy import text

from skyway.contracts.mission import BookMissions
from skyway.contracts.shortlist import Shortlist
from skyway.ids import DeliveryId, DroneId, HoldId, NetworkId, ProviderId, StationId
from skyway.runtime.sql.database import Tx
from skyway.scheduling.trip import BookedPad
from tests.row_locks import free_keys, until_a_lock_is_waited_for

# SQLite has one writer: there is no order to keep.
pytestmark = [
    pytest.mark.parametrize("migrated_url", ["postgresql"], indirect=True),
    pytest.mark.integration,
]

PROVIDER = ProviderId("prv_1")
DRONES = [DroneId(f"drn_{number}") for number in (1, 2, 3)]
STATIONS = [StationId(name) for name in "abc"]


async def met(composition: Any, drone: Any) -> None:
    """All drones have sent a state, so they have links."""
    await composition.receive(*(replace(drone, drone_id=each, stream=0).state() for each in DRONES))


async def free_rows_of_a_waiting_lock(
    composition: Any,
    table: str,
    key: str,
    keys: Sequence[str],
    lock: Callable[[Tx], Awaitable[Any]],
) -> set[str]:
    """Those of the rows `keys` that stay free while `lock` waits for the first of them."""
    first = f"{key} = '{keys[0]}'"
    async with composition.db.write() as tx:
        # The changed row now lies behind the others.
        await tx.execute(text(f"UPDATE {table} SET {key} = {key} WHERE {first}"))

    async def wait() -> None:
        async with composition.db.write() as tx:
            for setting in ("enable_indexscan", "enable_bitmapscan"):
                await tx.execute(text(f"SET LOCAL {setting} = off"))
            await lock(tx)

    async with composition.db.write() as tx:
        await tx.execute(text(f"SELECT {key} FROM {table} WHERE {first} FOR UPDATE"))
        waiting = asyncio.create_task(wait())
        await until_a_lock_is_waited_for(composition.db)
        free = await free_keys(composition.db, table, key)
    await waiting
    return free & set(keys)


async def test_stations_are_locked_in_sorted_order(composition: Any) -> None:
    booked = [BookedPad(each, 0, 0, 1) for each in reversed(STATIONS)]

    free = await free_rows_of_a_waiting_lock(
        composition, "stations", "station_id", STATIONS, lambda tx: lock_stations(tx, booked)
    )

    assert free == set(STATIONS[1:])


async def test_a_claim_in_one_statement_locks_stations_in_sorted_order(
    composition: Any, drone: Any
) -> None:
    await met(composition, drone)
    seen = Snapshot(Present(NetworkId("row"), 1, 0), {DRONES[0]: 0})

    async def claim(tx: Tx) -> None:
        place = await claim_in_one_statement(
            tx, seen, DRONES[0], PROVIDER, station_ids=STATIONS[::-1], now_ms=0
        )
        assert place is not None

    free = await free_rows_of_a_waiting_lock(composition, "stations", "station_id", STATIONS, claim)

    assert free == set(STATIONS[1:])


async def test_the_drones_of_a_hold_are_locked_in_sorted_order(
    composition: Any, drone: Any
) -> None:
    await met(composition, drone)
    async with composition.db.write() as tx:
        await tx.execute(text("UPDATE drone_links SET held_by = 'hld_1', held_until_ms = 1"))

    async def give_up(tx: Tx) -> None:
        await free_drones(tx, HoldId("hld_1"))

    free = await free_rows_of_a_waiting_lock(
        composition, "drone_links", "drone_id", DRONES, give_up
    )

    assert free == set(DRONES[1:])


async def test_links_are_locked_in_sorted_order(composition: Any, drone: Any) -> None:
    await met(composition, drone)

    free = await free_rows_of_a_waiting_lock(
        composition, "drone_links", "drone_id", DRONES, lambda tx: lock_links(tx, DRONES[::-1])
    )

    assert free == set(DRONES[1:])


async def test_missions_are_locked_in_the_order_of_their_drones(
    composition: Any, make: Any
) -> None:
    for number in (1, 2, 3):
        await composition.book(make.candidate(number), delivery_id=f"dlv_{number}")

    free = await free_rows_of_a_waiting_lock(
        composition, "missions", "drone_id", DRONES, lambda tx: lock_live(tx, DRONES[::-1])
    )

    assert free == set(DRONES[1:])


async def test_the_drones_of_one_booking_are_locked_in_sorted_order(
    composition: Any, drone: Any, make: Any
) -> None:
    await met(composition, drone)
    network = make.network()
    for feature in network["features"]:
        if feature["properties"]["kind"] == "segment":
            feature["properties"]["length_m"] = 4_000
    await composition.publish(network)
    # Each drone carries one package; which drone has the first trip does not follow from its id.
    request = make.request("b", "c", "b", mass_kg=9.0)
    model = make.candidate().model
    candidates = [
        make.candidate(
            number,
            model=model.model_copy(
                update={"model_id": f"lifts-{number}", "max_payload_kg": 15.0 + number}
            ),
        )
        for number in (1, 2, 3)
    ]
    requested = BookMissions(attempt=1, request=request, shortlist=Shortlist.of(candidates))

    async with composition.db.write() as tx:
        await lock_links(tx, [DRONES[0]])
        booking = asyncio.create_task(
            composition.parts.bookings.book(DeliveryId("dlv_1"), requested)
        )
        await until_a_lock_is_waited_for(composition.db)
        free = await free_keys(composition.db, "drone_links", "drone_id")

    flown = [mission.drone_id for mission in (await booking).missions]
    assert flown != sorted(flown)
    assert free == set(DRONES[1:])


async def test_links_of_new_drones_are_added_in_sorted_order(composition: Any, drone: Any) -> None:
    """Another replica meets the same drones; in another order the two would wait for each other."""
    new = [DroneId(f"drn_{number}") for number in range(1, 9)]
    batch = [replace(drone, drone_id=each, stream=0).state() for each in reversed(new)]

    async with composition.db.write() as tx:
        await lock_or_add_links(tx, {new[0]: PROVIDER}, new[:1])
        following = asyncio.create_task(composition.receive(*batch))
        await until_a_lock_is_waited_for(composition.db)
        for each in new[1:]:
            await lock_or_add_links(tx, {each: PROVIDER}, [each])
    await following

    links = await composition.rows("SELECT drone_id FROM drone_links WHERE state IS NOT NULL")
    assert {row.drone_id for row in links} == set(new)
