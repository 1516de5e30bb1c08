"""The dispatcher moves what waits, and every calendar stays whole."""

import pytest

from tests.composition.busy_network import NETWORK_ID
from tests.composition.busy_world import BusyWorld
from tests.composition.dispatched_world import (
    PROVIDER,
    dispatch_fairly,
    dispatcher_of,
    waiting_missions,
)
from tests.composition.missions.calendar.booked_chain import book, delivered_by, etas, reports_of

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)


async def book_unevenly(world: BusyWorld) -> None:
    """Four missions for the first drone, and one for the second."""
    for number in range(1, 5):
        assert await book(world, f"dlv{number}", "a", "b", drone=1) == "BOOKED"
    assert await book(world, "dlv5", "b", "c", drone=2) == "BOOKED"


async def test_a_mission_moves_to_a_drone_that_delivers_it_sooner(world: BusyWorld) -> None:
    await book_unevenly(world)
    before = await etas(world)

    outcomes = await dispatch_fairly(world)

    assert outcomes[0] == "adopted"
    after = await etas(world)
    assert after["dlv3"] < before["dlv3"]
    (report,) = [each for each in await reports_of(world, "dlv3") if each.kind == "REPLANNED"]
    assert (report.drone_id, report.drone_before) == ("drn_2", "drn_1")
    assert report.mission is not None
    assert report.mission.drone_id == "drn_2"
    await world.end()
    assert sorted(delivered_by(world, 1) + delivered_by(world, 2)) == [
        f"dlv{number}" for number in range(1, 6)
    ]
    assert "dlv3" in delivered_by(world, 2)


async def test_a_drone_out_of_service_gets_no_mission(world: BusyWorld) -> None:
    await book_unevenly(world)

    dispatcher = dispatcher_of(world, withdrawn=frozenset({"drn_2"}))
    outcome = await dispatcher.look_at(NETWORK_ID, PROVIDER)

    assert outcome != "adopted"
    assert {each.drone_id for each in (await waiting_missions(world)).values()} == {"drn_1"}
    await world.end()
