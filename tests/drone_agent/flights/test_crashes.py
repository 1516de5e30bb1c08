"""After a crash at any moment the next process continues, and nothing happens twice."""

from datetime import timedelta
from typing import Any

import pytest

from skyway.contracts.topics import CONNECTION

PRE_START = timedelta(minutes=10)


@pytest.mark.parametrize("when", ["dies_before", "dies_after"])
@pytest.mark.parametrize("write", range(1, 20))
async def test_after_a_crash_at_any_write_each_step_happens_exactly_once(
    world: Any, cloud: Any, trip: Any, write: int, when: str
) -> None:
    setattr(world.journal, when, write)
    mission = cloud.mission(trip)
    await world.start()
    await world.send(mission)
    await world.pass_until(lambda: world.has_died or world.is_over)
    assert world.has_died

    await world.kill()
    setattr(world.journal, when, None)
    await world.start()
    await world.send(mission)
    await world.pass_until(lambda: world.is_over)

    assert [event.seq for event in world.events] == list(range(1, len(trip) + 2))
    assert [event.step_id for event in world.events] == [*(step.step_id for step in trip), None]
    assert {event.event for event in world.events[:-1]} == {"STEP_ENDED"}
    assert world.states[-1].package_ids == ()


async def test_no_twentieth_write_is_left_to_crash_at(world: Any, cloud: Any, trip: Any) -> None:
    await world.start()
    await world.send(cloud.mission(trip))

    await world.pass_until(lambda: world.is_over)

    assert world.journal.writes == 19


async def test_a_flight_goes_on_from_its_own_start_after_a_crash(
    world: Any, cloud: Any, trip: Any
) -> None:
    await world.start()
    await world.send(cloud.mission(trip))
    await world.pass_until(lambda: any(state.activity == "FLYING" for state in world.states))

    await world.kill()
    await world.pass_time(timedelta(seconds=100))
    await world.start()
    await world.pass_until(lambda: len(world.events) == 2)

    flown = world.events[1]
    assert abs(flown.started_at - trip[1].planned_start_at) < timedelta(milliseconds=1)
    assert abs(flown.ended_at - trip[1].planned_end_at) < timedelta(milliseconds=1)


async def test_no_step_begins_while_no_agent_runs(world: Any, cloud: Any, trip: Any) -> None:
    await world.start()
    await world.send(cloud.mission(trip))
    await world.pass_until(lambda: len(world.events) == 3)

    await world.kill()
    await world.pass_time(timedelta(hours=1))
    await world.start()
    back_at = world.clock.now()
    await world.pass_until(lambda: world.events[-1].event == "STEP_FAILED")

    assert world.events[-1].code == "PAD_LOST"
    assert world.events[-1].ended_at == back_at


async def test_a_repeated_instruction_is_acked_again_and_done_once(
    world: Any, cloud: Any, trip: Any
) -> None:
    mission = cloud.mission(trip)
    await world.start()
    await world.send(mission)
    await world.pass_until(lambda: len(world.events) == 1)

    await world.send(mission)
    await world.pass_until(lambda: world.is_over)

    assert [ack.status for ack in world.acks] == ["RECEIVED", "ACCEPTED", "ACCEPTED"]
    assert [event.step_kind for event in world.events].count("PICK_UP") == 1


async def test_each_start_has_a_later_session(world: Any) -> None:
    await world.start()
    await world.kill()
    await world.start()

    sessions = [one.session for one in world.messages(CONNECTION) if one.status == "ONLINE"]
    assert sessions[0] < sessions[-1]


async def test_a_revision_of_a_released_step_is_refused_and_the_flight_goes_on(
    world: Any, cloud: Any, trip: Any, steps: Any
) -> None:
    await world.start()
    await world.send(cloud.mission(trip))
    await world.pass_until(lambda: any(state.activity == "FLYING" for state in world.states))

    too_late = steps(first_step=3).fly("over", "farm", length_m=4000, duration_s=300)
    await world.send(cloud.mission(too_late.made, revision=2))
    await world.pass_until(lambda: world.is_over)

    assert (world.acks[-1].status, world.acks[-1].code) == ("REJECTED", "STEP_RELEASED")
    assert [event.step_id for event in world.events] == [*range(1, 9), None]


async def test_a_mission_accepted_before_a_crash_is_flown_without_being_sent_again(
    world: Any, cloud: Any, trip: Any
) -> None:
    await world.start()
    await world.send(cloud.mission(trip))

    await world.kill()
    await world.start()
    await world.pass_until(lambda: world.is_over)

    assert [event.step_id for event in world.events] == [*range(1, 9), None]
