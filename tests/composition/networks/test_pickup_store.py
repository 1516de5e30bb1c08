"""A drone waits near the next pickup that is expected from its provider's last requests."""

import asyncio
from datetime import timedelta
from typing import Any

import pytest
from skyway_composition.missions.mission.step_store import replace_steps
from skyway_composition.networks.pickup_store import PastPickups
from skyway_composition.planning.find_trip import TripFinder
from skyway_composition.planning.world import World
from skyway_composition.tables import custody, instructions, missions, pad_reservations
from sqlalchemy import delete

from skyway.drone.models import DRONE_MODELS
from skyway.ids import DroneId, DroneModelId, NetworkId, ProviderId, StationId
from skyway.network.network import Network
from skyway.runtime.clock import FleetClock
from skyway.scheduling.standby import StandbyChoice
from skyway.scheduling.trip import Trip
from skyway.units import moment_to_ms

#: Flies there and back without a recharge.
FAR_FLYER = DRONE_MODELS[DroneModelId("dji-matrice-300-rtk")]


async def book_pickups_at_b(composition: Any, make: Any, count: int = 10) -> None:
    """Book requests from b to c, each on a drone of its own that stays at e."""
    for number in range(2, 2 + count):
        drone = make.candidate(
            number, model=FAR_FLYER, station_id="c", home_station_id="e", standby="HOME"
        )
        booking = await composition.book(
            drone, delivery_id=f"dlv_{number}", request=make.request("c", pickup="b")
        )
        assert booking.outcome == "BOOKED", booking


async def waits_at(composition: Any, make: Any, **members: Any) -> StationId:
    """Where a drone of provider 1 waits after a delivery at d."""
    skyway = await composition.parts.networks.current("row")
    world = await World.of(skyway, composition.db, after_ms=0)
    start_ms = moment_to_ms(composition.clock.now())
    finder = TripFinder(composition.parts.solver, world, start_ms, None)
    candidate = make.candidate(model=FAR_FLYER, standby="NEXT_PICKUP", **members)
    trip = await finder.trip(candidate, make.request("d", pickup="c"))
    assert isinstance(trip, Trip)
    assert trip.home_recharge is not None
    return trip.home_recharge.station_id


async def test_a_drone_waits_near_the_pickups_of_its_own_provider(
    composition: Any, make: Any
) -> None:
    at = {"station_id": "c", "home_station_id": "e"}
    assert await waits_at(composition, make, **at) == "e"  # nothing is known: home

    await book_pickups_at_b(composition, make)
    composition.clock.advance(timedelta(seconds=6))

    assert await waits_at(composition, make, **at) == "b"
    assert await waits_at(composition, make, provider_id="prv_2", **at) == "e"
    drone = make.candidate(model=FAR_FLYER, standby="NEXT_PICKUP", **at)
    booking = await composition.book(drone, request=make.request("d", pickup="c"))
    assert booking.missions[0].home_recharge.station_id == "b"
    assert await composition.broken() == []


async def places_in(
    network: Network, past: PastPickups, clock: FleetClock
) -> tuple[StationId, ...]:
    """The places that are worth the way for a drone of provider 1 that is empty at d."""
    drone = ProviderId("prv_1"), DroneId("drn_1")
    choice = StandbyChoice("NEXT_PICKUP", StationId("e"), drone)
    at_ms = moment_to_ms(clock.now())
    return (await past.with_places(choice, network, start=StationId("d"), at_ms=at_ms)).places


async def test_a_place_is_full_as_soon_as_a_drone_is_booked_to_wait_there(
    composition: Any, make: Any
) -> None:
    """Each of two replicas has cached the last missions before the booking."""
    await composition.publish(make.network(pads={"b": 1}))
    await book_pickups_at_b(composition, make)
    skyway = await composition.parts.networks.current("row")
    other_replica = PastPickups(composition.db, composition.clock, NetworkId("row"))
    caches = skyway.past_pickups, other_replica
    for each in caches:
        assert "b" in await places_in(skyway.network, each, composition.clock)

    at = {"station_id": "c", "home_station_id": "e"}
    drone = make.candidate(20, model=FAR_FLYER, standby="NEXT_PICKUP", **at)
    booking = await composition.book(
        drone, delivery_id="dlv_20", request=make.request("c", pickup="b")
    )
    assert booking.missions[0].home_recharge.station_id == "b"

    for each in caches:
        assert "b" not in await places_in(skyway.network, each, composition.clock)

    # The dispatcher deletes the mission of a guest: its drone does not wait there any more.
    composition.clock.advance(timedelta(seconds=6))
    for each in caches:
        assert "b" not in await places_in(skyway.network, each, composition.clock)
    mission_id = booking.missions[0].mission_id
    async with composition.db.write() as tx:
        await replace_steps(tx, mission_id, (), first_step=1, revision=1)
        for table in (instructions, pad_reservations, custody, missions):
            await tx.execute(delete(table).where(table.c.mission_id == mission_id))
    for each in caches:
        assert "b" in await places_in(skyway.network, each, composition.clock)


async def test_only_the_last_missions_of_a_provider_in_all_networks_are_looked_at(
    composition: Any, make: Any
) -> None:
    """A provider with a million missions in another network does not slow a booking down."""
    await book_pickups_at_b(composition, make)
    network = (await composition.parts.networks.current("row")).network
    db, clock, network_id = composition.db, composition.clock, NetworkId("row")

    enough = PastPickups(db, clock, network_id, most_looked_at=10)
    too_few = PastPickups(db, clock, network_id, most_looked_at=9)

    assert await places_in(network, enough, clock) != ()
    assert await places_in(network, too_few, clock) == ()


@pytest.mark.databases("sqlite")
async def test_other_work_goes_on_while_places_are_compared(composition: Any, make: Any) -> None:
    await book_pickups_at_b(composition, make)
    network = (await composition.parts.networks.current("row")).network
    past = PastPickups(composition.db, composition.clock, NetworkId("row"))
    await places_in(network, past, composition.clock)
    worked: list[str] = []

    async def work() -> None:
        worked.append("worked")

    task = asyncio.create_task(work())
    # The last missions are cached, so nothing else is awaited.
    assert await places_in(network, past, composition.clock) != ()

    assert worked == ["worked"]
    await task
