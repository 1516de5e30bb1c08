"""A drone's standby ends early for its next mission, and comes back when that one is gone."""

from datetime import timedelta

import pytest

from skyway.units import moment_to_ms
from tests.composition.busy_world import BusyWorld
from tests.composition.dispatched_world import dispatch_fairly, waiting_missions
from tests.composition.missions.queue.booked_chain import (
    book,
    book_chain,
    delivered_by,
    request,
)
from tests.long_cases import sampled

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)


@pytest.mark.parametrize("length", sampled([2, 3], every=2))
async def test_a_drone_flies_home_and_charges_when_its_last_mission_is_cancelled(
    world: BusyWorld, length: int
) -> None:
    await book_chain(world, length)
    await world.pass_time(timedelta(minutes=2))

    await world.cancel(f"dlv{length}", None)
    await world.keep_calendars()
    await world.check()
    await world.end()

    drone = world.drones[0]
    assert drone.logbook.station_id == drone.drone.home_station_id
    assert drone.logbook.soc > 0.9


@pytest.mark.parametrize("is_agreed", [False, True], ids=["before", "after"])
async def test_a_drone_whose_last_waiting_mission_moves_away_flies_home_and_charges(
    world: BusyWorld, is_agreed: bool
) -> None:
    """Before or after its drone has agreed to end its standby for that mission."""
    assert await book(world, "dlv1", "a", "b", "c", drone=1) == "BOOKED"
    assert await book(world, "dlv2", "a", "c", drone=2) == "BOOKED"
    asked = request("dlv3", "c", "a")
    first = world.drones[:1]
    assert await world.book("dlv3", asked, loading="AUTOMATIC", drones=first) == "BOOKED"
    if is_agreed:
        await world.keep_calendars()

    assert (await dispatch_fairly(world))[0] == "adopted"

    assert [each.drone_id for each in (await waiting_missions(world)).values()] == ["drn_2"]
    await world.end()
    assert delivered_by(world, 2) == ["dlv2", "dlv3"]
    assert first[0].logbook.station_id == first[0].drone.home_station_id
    assert first[0].logbook.soc > 0.9


async def test_a_waiting_mission_that_stays_ends_its_standby_for_one_that_comes(
    world: BusyWorld,
) -> None:
    """It begins too soon to move. Without another mission its drone would charge after it."""
    assert await book(world, "dlv1", "c", "b", drone=4) == "BOOKED"
    assert await book(world, "dlv2", "b", "a", drone=4) == "BOOKED"
    assert await book(world, "dlv3", "a", "b", "c", drone=1) == "BOOKED"
    assert await book(world, "dlv4", "a", "b", drone=1) == "BOOKED"
    await world.pass_time(timedelta(minutes=11))

    assert (await dispatch_fairly(world))[0] == "adopted"

    stays, comes = (await waiting_missions(world)).values()
    assert [each.mission.delivery_id for each in (stays, comes)] == ["dlv2", "dlv4"]
    assert stays.drone_id == comes.drone_id == "drn_4"
    assert moment_to_ms(stays.mission.released_at) <= comes.start.at_ms
    await world.end()
