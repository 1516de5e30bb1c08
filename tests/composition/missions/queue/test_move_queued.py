"""A mission that moves is stored with the place where its drone begins it now."""

import pytest

from tests.composition.busy_world import BusyWorld
from tests.composition.missions.queue.booked_chain import book_chain

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)


async def test_a_mission_begins_where_the_drone_stands_after_the_one_before_is_cancelled(
    world: BusyWorld,
) -> None:
    await book_chain(world, 2)
    _, second = await world.planned()
    assert second.start.station_id == "b"

    await world.cancel("dlv1", None)
    await world.keep_calendars()

    [moved] = await world.planned()
    assert (moved.mission_id, moved.start.station_id) == (second.mission_id, "a")
    await world.check()
