"""What becomes of the missions behind one that fails or is cancelled."""

from datetime import timedelta

import pytest
from skyway_drone_agent.simulated.disturbances import Disturbances

from tests.composition.busy_world import BusyWorld
from tests.composition.left_packages import left_to_book
from tests.composition.missions.queue.booked_chain import (
    CHAIN,
    book,
    book_chain,
    delivered_by,
    kinds_of,
    pass_minutes,
    reports_of,
    waiting,
)

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)


async def test_the_missions_behind_a_drone_that_breaks_down_are_refused_immediately(
    world: BusyWorld,
) -> None:
    await book_chain(world)
    (drone, *_) = world.drones
    drone.disturbances = Disturbances.model_validate({"motor": {"share": 1.0, "after_s": 60}})
    await drone.restart(with_journal=True)

    await pass_minutes(world, 6)

    assert await world.planned() == []
    for delivery_id in [*CHAIN][1:]:
        refused = (await reports_of(world, delivery_id))[-1]
        assert (refused.kind, refused.code) == ("REFUSED", "DRONE_NOT_FREE")
        assert "landed away from every station" in (refused.detail or "")
    await world.end()


async def test_another_drone_delivers_what_waited_behind_a_broken_drone(world: BusyWorld) -> None:
    await book_chain(world, 3)
    (drone, *_) = world.drones
    drone.disturbances = Disturbances.model_validate({"motor": {"share": 1.0, "after_s": 60}})
    await drone.restart(with_journal=True)
    await pass_minutes(world, 6)

    assert await book(world, "dlv2", *CHAIN["dlv2"], drone=3) == "BOOKED"
    assert await book(world, "dlv3", *CHAIN["dlv3"], drone=4) == "BOOKED"

    await world.end()
    assert delivered_by(world, 3) == ["dlv2"]
    assert delivered_by(world, 4) == ["dlv3"]


@pytest.mark.long
async def test_no_mission_waits_for_ever_behind_a_drone_that_is_silent(world: BusyWorld) -> None:
    await book_chain(world, 3)
    (drone, *_) = world.drones
    await pass_minutes(world, 8)
    drone.set_reception(False)
    drone.is_held_back = True

    await pass_minutes(world, 240)

    assert await waiting(world) == []
    for delivery_id in ("dlv2", "dlv3"):
        refused = (await reports_of(world, delivery_id))[-1]
        assert (refused.kind, refused.code) == ("REFUSED", "DRONE_NOT_FREE")
    await world.end()


@pytest.mark.long
async def test_a_mission_that_cannot_be_planned_for_long_is_refused(world: BusyWorld) -> None:
    await book_chain(world, 3)
    # The drone must charge before the third delivery, and no pad is left.
    for station_id in "abc":
        await world.close("PAD", station_id=station_id, pad=0)

    await pass_minutes(world, 240)

    assert await waiting(world) == []
    assert (await reports_of(world, "dlv3"))[-1].kind == "REFUSED"


async def test_a_mission_whose_destination_closes_is_refused_and_the_others_are_flown(
    world: BusyWorld,
) -> None:
    await book_chain(world, 1)
    assert await book(world, "dlv2", "b", "c") == "BOOKED"
    assert await book(world, "dlv3", "b", "a") == "BOOKED"

    await world.close("STATION", station_id="c")
    await world.keep_calendars()

    assert await waiting(world) == ["dlv3"]
    assert (await reports_of(world, "dlv2"))[-1].kind == "REFUSED"
    await world.end()
    assert delivered_by(world) == ["dlv1", "dlv3"]


async def test_the_missions_behind_a_cancelled_one_are_planned_again_immediately(
    world: BusyWorld,
) -> None:
    await book_chain(world, 4)

    await world.cancel("dlv3", None)
    await world.check()
    await world.keep_calendars()

    assert await waiting(world) == ["dlv2", "dlv4"]
    second, fourth = (await world.planned())[1:]
    assert fourth.start.station_id == "c"
    assert second.served_ms <= fourth.start.at_ms <= second.served_ms + 600_000
    await world.end()
    assert delivered_by(world) == ["dlv1", "dlv2", "dlv4"]


@pytest.mark.long
async def test_a_mission_that_loses_one_of_two_packages_is_booked_again_for_the_other(
    world: BusyWorld,
) -> None:
    await book_chain(world, 1)
    assert await book(world, "dlv2", "b", "c", "c") == "BOOKED"

    answer = await world.cancel("dlv2", ("dlv2_1",))

    assert answer.released == ("dlv2_1",)
    assert await waiting(world) == []
    kinds = await kinds_of(world, "dlv2")
    assert (kinds["RELEASED"], kinds["REFUSED"]) == (1, 1)
    left = await left_to_book(world, "dlv2")
    assert left is not None
    assert [each.package_id for each in left.packages] == ["dlv2_2"]
    assert await world.book("dlv2", left, loading="AUTOMATIC", drones=world.drones[:1]) == "BOOKED"
    await world.end()
    assert delivered_by(world) == ["dlv1", "dlv2"]


async def test_a_cancelled_last_mission_keeps_the_promises_before_it(
    world: BusyWorld,
) -> None:
    await book_chain(world, 3)
    before = {each.mission_id: each.start for each in await world.planned()}

    await world.cancel("dlv3", None)
    await world.keep_calendars()

    assert {each.mission_id: each.start for each in await world.planned()} == {
        each.mission_id: before[each.mission_id] for each in await world.planned()
    }
    # It is planned again, because its drone needs a standby again; its customer is not notified.
    assert (await kinds_of(world, "dlv2"))["REPLANNED"] == 0
    await world.pass_time(timedelta(minutes=1))
    await world.check()
