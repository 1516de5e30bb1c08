"""What a drone does next, decided without waiting for anything."""

from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from skyway_drone_agent.flying.mission import Act, Begin, End, Fail, Gates, Stand, next_act
from skyway_drone_agent.journal.logbook import CurrentMission, Logbook
from skyway_drone_agent.journal.records import Answer
from skyway_drone_agent.simulated.vehicle import SimulatedVehicle
from skyway_drone_agent.vehicle import StepRun

from skyway.runtime.clock import ManualClock

START = datetime(2026, 3, 1, 12, tzinfo=UTC)

ANSWER = Answer(instruction_id="ins_1", stream=1, seq=1, status="ACCEPTED")


@pytest.fixture
def logbook(drone: Any, trip: Any) -> Logbook:
    """A drone at home with an accepted mission, long before it begins."""
    mission = CurrentMission(
        mission_id="msn_1",
        revision=1,
        delivery_id="dlv_1",
        accepted_by=ANSWER,
        expires_at=START + timedelta(minutes=1),
        acceptance_sent_at=START,
        first_step=1,
        steps=tuple(trip),
        released_through=0,
        free_at=START,
    )
    home: Logbook = drone.at_first()
    return home.model_copy(update={"mission": mission})


def with_mission(logbook: Logbook, **changes: Any) -> Logbook:
    assert logbook.mission is not None
    return logbook.model_copy(update={"mission": logbook.mission.model_copy(update=changes)})


def decide(drone: Any, logbook: Logbook, *, at: Any, gates: Gates | None = None) -> Act:
    clock = ManualClock(START)
    began = clock.now()
    return next_act(
        logbook,
        vehicle=SimulatedVehicle(drone.model, clock),
        now=at,
        gates=gates or Gates(take_off_at=began, loading_at=began),
        agent_started_at=began,
    )


def test_without_a_mission_a_drone_stands(drone: Any) -> None:
    act = decide(drone, drone.at_first(), at=START)

    assert act == Stand(until=None)


def test_before_the_planned_start_a_drone_stands(drone: Any, logbook: Logbook, trip: Any) -> None:
    assert decide(drone, logbook, at=START) == Stand(until=trip[0].planned_start_at)


def test_a_step_begins_at_its_moment_however_late_the_process_wakes(
    drone: Any, logbook: Logbook, trip: Any
) -> None:
    woken_at = trip[0].planned_start_at + timedelta(seconds=17)

    act = decide(drone, logbook, at=woken_at)

    assert act == Begin(trip[0], at=trip[0].planned_start_at, released_through=1)


def test_a_step_that_has_begun_is_performed(drone: Any, logbook: Logbook, trip: Any) -> None:
    begun = with_mission(logbook, began_at=trip[0].planned_start_at)

    act = decide(drone, begun, at=trip[0].planned_start_at)

    assert isinstance(act, StepRun)
    assert act.started_at == trip[0].planned_start_at


def test_a_take_off_releases_all_steps_up_to_the_landing(
    drone: Any, logbook: Logbook, trip: Any
) -> None:
    loaded = with_mission(logbook, steps=tuple(trip[1:]))

    act = decide(drone, loaded, at=trip[1].planned_start_at)

    assert act == Begin(trip[1], at=trip[1].planned_start_at, released_through=3)


def test_a_flight_over_a_station_goes_on_without_the_link(
    drone: Any, logbook: Logbook, trip: Any
) -> None:
    over = with_mission(
        logbook, steps=tuple(trip[2:]), released_through=3, free_at=trip[1].planned_end_at
    )
    closed = Gates(take_off_at=None, loading_at=None)

    act = decide(drone, over, at=trip[1].planned_end_at, gates=closed)

    assert act == Begin(trip[2], at=trip[1].planned_end_at, released_through=3)


def test_loading_fails_when_the_acceptance_was_confirmed_after_the_expiry(
    drone: Any, logbook: Logbook, trip: Any
) -> None:
    mission_sent_late = with_mission(logbook, acceptance_sent_at=START + timedelta(minutes=2))

    act = decide(drone, mission_sent_late, at=trip[0].planned_start_at)

    assert act == Fail(trip[0], at=trip[0].planned_start_at, code="EXPIRED")


def test_a_lost_link_keeps_a_landed_drone_on_the_ground(
    drone: Any, logbook: Logbook, trip: Any
) -> None:
    landed = with_mission(logbook, steps=tuple(trip[5:]), released_through=5)
    closed = Gates(take_off_at=None, loading_at=None)

    act = decide(drone, landed, at=trip[5].planned_start_at, gates=closed)

    assert act == Stand(until=None)


def test_a_drone_without_the_energy_does_not_take_off(
    drone: Any, logbook: Logbook, trip: Any
) -> None:
    weak = with_mission(logbook, steps=tuple(trip[1:])).model_copy(update={"soc": 0.2})

    act = decide(drone, weak, at=trip[1].planned_start_at)

    assert isinstance(act, Fail)
    assert (act.code, act.step) == ("INSUFFICIENT_ENERGY", trip[1])
    assert act.data["have_j"] == pytest.approx(0.1 * 360_000)


def test_a_pad_whose_reservation_is_over_is_lost(drone: Any, logbook: Logbook, trip: Any) -> None:
    late = with_mission(logbook, steps=tuple(trip[4:]), free_at=trip[4].not_after_at)

    act = decide(drone, late, at=trip[4].not_after_at)

    assert act == Fail(trip[4], at=trip[4].not_after_at, code="PAD_LOST")


def test_after_a_failure_a_drone_waits_for_a_new_revision(drone: Any, logbook: Logbook) -> None:
    failed = with_mission(logbook, has_failed=True)

    assert decide(drone, failed, at=START + timedelta(days=1)) == Stand(until=None)


def test_a_mission_ends_when_its_last_step_did(drone: Any, logbook: Logbook, trip: Any) -> None:
    done = with_mission(logbook, steps=(), free_at=trip[-1].planned_end_at)

    act = decide(drone, done, at=trip[-1].planned_end_at)

    assert act == End(at=trip[-1].planned_end_at)
