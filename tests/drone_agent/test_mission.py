"""What a drone does next, decided without waiting for anything."""

from datetime import timedelta
from typing import Any

import pytest
from skyway_drone_agent.logbook import CurrentMission, Logbook
from skyway_drone_agent.mission import Act, Begin, End, Fail, Gates, Stand, next_act
from skyway_drone_agent.records import Answer
from skyway_drone_agent.simulated_vehicle import SimulatedVehicle
from skyway_drone_agent.vehicle import StepRun

ANSWER = Answer(instruction_id="ins_1", stream=1, seq=1, status="ACCEPTED")


@pytest.fixture
def logbook(world: Any, trip: Any) -> Logbook:
    """A drone at home with an accepted mission, long before it begins."""
    mission = CurrentMission(
        mission_id="msn_1",
        revision=1,
        delivery_id="dlv_1",
        accepted_by=ANSWER,
        first_step=1,
        steps=tuple(trip),
        released_through=0,
        free_at=world.clock.now(),
    )
    home: Logbook = world.drone.at_first()
    return home.model_copy(update={"mission": mission})


def with_mission(logbook: Logbook, **changes: Any) -> Logbook:
    assert logbook.mission is not None
    return logbook.model_copy(update={"mission": logbook.mission.model_copy(update=changes)})


def decide(world: Any, logbook: Logbook, *, at: Any, gates: Gates | None = None) -> Act:
    began = world.clock.now()
    return next_act(
        logbook,
        vehicle=SimulatedVehicle(world.drone.model, world.clock),
        now=at,
        gates=gates or Gates(take_off_at=began, loading_at=began),
        agent_started_at=began,
    )


def test_without_a_mission_a_drone_stands(world: Any) -> None:
    act = decide(world, world.drone.at_first(), at=world.clock.now())

    assert act == Stand(until=None)


def test_before_the_planned_start_a_drone_stands(world: Any, logbook: Logbook, trip: Any) -> None:
    assert decide(world, logbook, at=world.clock.now()) == Stand(until=trip[0].planned_start_at)


def test_a_step_begins_at_its_moment_however_late_the_process_wakes(
    world: Any, logbook: Logbook, trip: Any
) -> None:
    woken_at = trip[0].planned_start_at + timedelta(seconds=17)

    act = decide(world, logbook, at=woken_at)

    assert act == Begin(trip[0], at=trip[0].planned_start_at, released_through=1)


def test_a_step_that_has_begun_is_performed(world: Any, logbook: Logbook, trip: Any) -> None:
    begun = with_mission(logbook, began_at=trip[0].planned_start_at)

    act = decide(world, begun, at=trip[0].planned_start_at)

    assert isinstance(act, StepRun)
    assert act.started_at == trip[0].planned_start_at


def test_a_take_off_releases_all_steps_up_to_the_landing(
    world: Any, logbook: Logbook, trip: Any
) -> None:
    loaded = with_mission(logbook, steps=tuple(trip[1:]))

    act = decide(world, loaded, at=trip[1].planned_start_at)

    assert act == Begin(trip[1], at=trip[1].planned_start_at, released_through=3)


def test_a_flight_over_a_station_goes_on_without_the_link(
    world: Any, logbook: Logbook, trip: Any
) -> None:
    over = with_mission(
        logbook, steps=tuple(trip[2:]), released_through=3, free_at=trip[1].planned_end_at
    )
    closed = Gates(take_off_at=None, loading_at=None)

    act = decide(world, over, at=trip[1].planned_end_at, gates=closed)

    assert act == Begin(trip[2], at=trip[1].planned_end_at, released_through=3)


def test_a_lost_link_keeps_a_landed_drone_on_the_ground(
    world: Any, logbook: Logbook, trip: Any
) -> None:
    landed = with_mission(logbook, steps=tuple(trip[5:]), released_through=5)
    closed = Gates(take_off_at=None, loading_at=None)

    act = decide(world, landed, at=trip[5].planned_start_at, gates=closed)

    assert act == Stand(until=None)


def test_a_drone_without_the_energy_does_not_take_off(
    world: Any, logbook: Logbook, trip: Any
) -> None:
    weak = with_mission(logbook, steps=tuple(trip[1:])).model_copy(update={"soc": 0.2})

    act = decide(world, weak, at=trip[1].planned_start_at)

    assert isinstance(act, Fail)
    assert (act.code, act.step) == ("INSUFFICIENT_ENERGY", trip[1])
    assert act.data["have_j"] == pytest.approx(0.1 * 360_000)


def test_a_pad_whose_reservation_is_over_is_lost(world: Any, logbook: Logbook, trip: Any) -> None:
    late = with_mission(logbook, steps=tuple(trip[4:]), free_at=trip[4].not_after_at)

    act = decide(world, late, at=trip[4].not_after_at)

    assert act == Fail(trip[4], at=trip[4].not_after_at, code="PAD_LOST")


def test_after_a_failure_a_drone_waits_for_a_new_revision(world: Any, logbook: Logbook) -> None:
    failed = with_mission(logbook, has_failed=True)

    assert decide(world, failed, at=world.clock.now() + timedelta(days=1)) == Stand(until=None)


def test_a_mission_ends_when_its_last_step_did(world: Any, logbook: Logbook, trip: Any) -> None:
    done = with_mission(logbook, steps=(), free_at=trip[-1].planned_end_at)

    act = decide(world, done, at=trip[-1].planned_end_at)

    assert act == End(at=trip[-1].planned_end_at)
