"""Missions that wait in a drone's calendar: they begin, move and end with the missions before."""

from datetime import timedelta

import pytest
from skyway_composition.missions.tracking import track_of

from skyway.ids import DeliveryId
from tests.composition.busy_world import BusyWorld
from tests.composition.missions.queue.booked_chain import book

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)


async def test_a_second_request_waits_behind_the_first_with_its_arrival_time(
    world: BusyWorld,
) -> None:
    assert await book(world, "dlv1", "a", "b") == "BOOKED"

    assert await book(world, "dlv2", "b", "c") == "BOOKED"

    first, second = await world.planned()
    assert (first.mission.state, second.mission.state) == ("ACCEPTED", "QUEUED")
    assert second.start.station_id == "b"
    assert first.served_ms < second.start.at_ms < first.served_ms + 600_000
    await world.check()


async def test_the_track_of_a_queued_mission_shows_its_planned_steps(world: BusyWorld) -> None:
    await book(world, "dlv1", "a", "b")
    await book(world, "dlv2", "b", "c")

    track = await track_of(world.db, DeliveryId("dlv2"))

    (mission,) = track.missions
    assert {step.status for step in mission.steps} == {"PLANNED"}
    assert (mission.steps[-1].kind, mission.steps[-1].station_id) == ("DELIVER", "c")
    assert mission.position is None


@pytest.mark.long
async def test_the_drone_delivers_the_second_package_without_flying_home_first(
    world: BusyWorld,
) -> None:
    await book(world, "dlv1", "a", "b")
    await book(world, "dlv2", "b", "c")
    first, second = await world.planned()
    promised = second.mission.packages[0].eta_at

    while await world.planned():
        await world.pass_time(timedelta(minutes=5))
        await world.check()

    (drone, *_) = world.drones
    flights = [
        (event.mission_id, event.station_id)
        for event in drone.journal.happened
        if event.event == "STEP_ENDED" and event.step_kind == "FLY"
    ]
    assert flights[0] == (first.mission_id, "b")
    assert flights[1] == (second.mission_id, "c")
    delivered = [event.ended_at for event in drone.journal.happened if event.step_kind == "DELIVER"]
    assert delivered[1] <= promised + timedelta(minutes=2)
    await world.end()
