"""New steps for a drone in the middle of a mission, judged without flying it."""

from datetime import timedelta
from typing import Any

import pytest
from skyway_drone_agent.flying.mission import Cut, Gates, next_act
from skyway_drone_agent.journal.logbook import CurrentMission
from skyway_drone_agent.journal.records import EventRecorded
from skyway_drone_agent.simulated.vehicle import SimulatedVehicle
from skyway_drone_agent.vehicle import Outcome

from skyway.contracts.drone_report import DroneEvent
from skyway.contracts.instruction import RefusalCode


@pytest.fixture
def over(desk: Any, trip: Any) -> Any:
    """A drone over the station that it flies over: one flight has ended, none has begun."""
    desk.send(desk.cloud.mission(trip))
    mission = desk.recorder.logbook.mission
    between = {
        "steps": tuple(trip[2:]),
        "released_through": 3,
        "free_at": desk.clock.now() - timedelta(seconds=1),
    }
    desk.drone_is(
        mission=mission.model_copy(update=between), station_id=None, packages=trip[0].packages
    )
    return desk


def mission_of(desk: Any) -> CurrentMission:
    mission: CurrentMission = desk.recorder.logbook.mission
    return mission


def test_over_a_station_a_drone_turns_without_standing_still(over: Any, steps: Any) -> None:
    before = mission_of(over)
    turn = steps(first_step=3).fly("over", "farm", length_m=4000, duration_s=300)

    assert over.send(over.cloud.divert(turn.made)).status == "ACCEPTED"

    assert mission_of(over).free_at == before.free_at
    assert (mission_of(over).steps, mission_of(over).released_through) == (tuple(turn.made), 3)


def test_over_a_station_a_drone_cannot_stand(over: Any, steps: Any) -> None:
    wait = steps(first_step=3).wait("over", duration_s=60)

    assert over.send(over.cloud.divert(wait.made)).code == RefusalCode.MALFORMED


def test_over_a_station_a_drone_cannot_turn_from_another_one(over: Any, steps: Any) -> None:
    elsewhere = steps(first_step=3).fly("home", "farm", length_m=4000, duration_s=300)

    answer = over.send(over.cloud.divert(elsewhere.made))

    assert (answer.code, answer.data) == (RefusalCode.NOT_AT_START, {"station_id": "over"})


def test_a_step_that_had_ended_by_itself_is_cut_then_but_nothing_begins_before_the_instruction(
    desk: Any, drone: Any, steps: Any
) -> None:
    wait = steps(at=desk.clock.now()).wait("home", duration_s=60)
    desk.send(desk.cloud.mission(wait.made))
    begun = {"began_at": desk.clock.now(), "released_through": 1}
    desk.drone_is(mission=mission_of(desk).model_copy(update=begun))
    desk.clock.move_to(desk.clock.now() + timedelta(hours=1))

    hop = steps(at=desk.clock.now()).fly("home", "farm", length_m=4000, duration_s=230)
    desk.send(desk.cloud.divert(hop.made))
    vehicle = SimulatedVehicle(drone.model, desk.clock)
    act = next_act(
        desk.recorder.logbook,
        vehicle=vehicle,
        now=desk.clock.now(),
        gates=Gates(take_off_at=None, loading_at=None),
        agent_started_at=desk.clock.now(),
    )

    assert isinstance(act, Cut)
    assert (act.at, act.revision) == (desk.clock.now(), 1)
    ended = vehicle.cut(act.run, act.at)
    assert ended.ended_at == wait.at
    desk.recorder.record(EventRecorded(event=end_of_wait(desk, ended)))
    assert (mission_of(desk).cut, mission_of(desk).free_at) == (None, desk.clock.now())


def end_of_wait(desk: Any, outcome: Outcome) -> DroneEvent:
    return DroneEvent(
        message_id="msg_1",
        sent_at=desk.clock.now(),
        session=1,
        seq=1,
        event="STEP_ENDED",
        stream=1,
        ended_at=outcome.ended_at,
        position=desk.recorder.logbook.position,
        soc=outcome.soc,
        code=outcome.code,
    )
