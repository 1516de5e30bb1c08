"""What a drone flew adds up to the delivery time; a drone that does nothing else waits."""

from datetime import UTC, datetime, timedelta

from skyway.cli.demo.flown import Flown, FlownMission
from skyway.contracts.drone_report import DroneEvent
from skyway.geo import Position

START_AT = datetime(2026, 3, 1, tzinfo=UTC)


def make_step(step_id: int, kind: str, start_s: float, end_s: float) -> DroneEvent:
    return DroneEvent.model_validate(
        {
            "message_id": "m",
            "sent_at": START_AT,
            "session": 1,
            "seq": step_id,
            "stream": 1,
            "event": "STEP_ENDED",
            "mission_id": "msn_1",
            "step_id": step_id,
            "step_kind": kind,
            "started_at": START_AT + timedelta(seconds=start_s),
            "ended_at": START_AT + timedelta(seconds=end_s),
            "position": Position(0, 0),
            "soc": 0.5,
            "energy_j": 100.0 if kind == "FLY" else 0.0,
        }
    )


def flown(*steps: DroneEvent) -> FlownMission:
    adding = Flown()
    for step in steps:
        adding.add(step)
    return adding.of("msn_1", start_at=START_AT)


def test_the_four_durations_add_up_to_the_delivery_time() -> None:
    # 10 s pass before the flight, and 20 s between the recharge and the next flight.
    mission = flown(
        make_step(1, "PICK_UP", 0, 60),
        make_step(2, "FLY", 70, 170),
        make_step(3, "RECHARGE", 170, 270),
        make_step(4, "FLY", 290, 300),
        make_step(5, "WAIT", 300, 305),
        make_step(6, "DELIVER", 305, 335),
    )

    assert mission == FlownMission(
        delivery_time_s=335,
        flight_s=110,
        recharging_s=100,
        handling_s=90,
        waiting_s=35,
        energy_j=200,
    )


def test_the_way_home_is_not_counted() -> None:
    delivered = (make_step(1, "FLY", 0, 100), make_step(2, "DELIVER", 100, 130))

    assert flown(*delivered, make_step(3, "FLY", 130, 500)) == flown(*delivered)


def test_only_what_happened_after_the_revised_start_is_counted() -> None:
    mission = flown(
        make_step(1, "FLY", -50, -10),
        make_step(2, "PICK_UP", -20, 40),
        make_step(3, "DELIVER", 40, 70),
    )

    assert (mission.delivery_time_s, mission.handling_s) == (70, 70)
    assert (mission.flight_s, mission.waiting_s, mission.energy_j) == (0, 0, 0)


def test_a_repeated_event_counts_once() -> None:
    steps = (make_step(1, "FLY", 0, 100), make_step(2, "DELIVER", 100, 130))

    assert flown(*steps, *steps) == flown(*steps)


def test_a_mission_without_a_delivery_has_flown_nothing_yet() -> None:
    assert flown(make_step(1, "FLY", 0, 100)) == FlownMission()
