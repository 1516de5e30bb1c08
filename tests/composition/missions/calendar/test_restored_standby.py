"""A drone gets its standby back when the mission for which it had ended early is cancelled."""

from datetime import timedelta

import pytest

from tests.composition.busy_world import BusyWorld
from tests.composition.missions.calendar.booked_chain import book_chain

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)


@pytest.mark.parametrize("length", [2, 3])
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
