"""Which stations a drone knows of: none that is only a place in the air."""

from typing import Any

from skyway_drone_agent.current_mission import CurrentMission, Escape, FlownBefore
from skyway_drone_agent.landings import NO_BOOK, KnownLandings, landings_of
from skyway_drone_agent.logbook import Logbook
from skyway_drone_agent.records import Answer

from skyway.contracts.drone_health import Failsafe, Fault
from skyway.geo import Position
from skyway.ids import DeliveryId, InstructionId, MissionId, StationId

IN_THE_AIR = Position(-97.85, 30.0)


def logbook_of(made: Any, *, station: str | None = "home", **changes: Any) -> Logbook:
    mission = CurrentMission(
        mission_id=MissionId("msn_1"),
        revision=1,
        delivery_id=DeliveryId("dlv_1"),
        accepted_by=Answer(
            instruction_id=InstructionId("ins_1"), stream=1, seq=1, status="ACCEPTED"
        ),
        expires_at=made[0].planned_start_at,
        first_step=1,
        steps=tuple(made),
        released_through=0,
        free_at=made[0].planned_start_at,
    )
    return Logbook(
        station_id=StationId(station) if station else None,
        position=Position(-98.0, 30.0),
        soc=1.0,
        mission=mission.model_copy(update=changes),
    )


def names(landings: Any) -> set[str]:
    return {landing.station_id for landing in landings}


def test_the_ends_of_all_flights_are_landings(trip: Any) -> None:
    assert names(landings_of(logbook_of(trip))) == {"home", "over", "shop", "farm"}


def test_a_flight_that_was_turned_does_not_begin_at_a_station(trip: Any) -> None:
    turned = trip[1].model_copy(update={"from_position": IN_THE_AIR})
    before = FlownBefore(since=trip[0].planned_start_at, used_j=1.0)
    logbook = logbook_of([turned], station=None, flown_before=before)

    assert names(landings_of(logbook)) == {"over"}


def test_straight_down_is_no_landing_but_the_flight_instead_of_it_was_for_one(trip: Any) -> None:
    down = trip[1].model_copy(update={"from_position": IN_THE_AIR, "to_position": IN_THE_AIR})
    escape = Escape(fault=Fault.MOTOR_FAILURE, failsafe=Failsafe.LAND_NOW, instead_of=trip[1])
    before = FlownBefore(since=trip[0].planned_start_at, used_j=1.0)
    logbook = logbook_of([down], station=None, escape=escape, flown_before=before)

    (landing,) = landings_of(logbook)

    assert (landing.station_id, landing.position) == ("over", trip[1].to_position)


def test_landings_that_were_passed_stay_known(trip: Any) -> None:
    known = KnownLandings(NO_BOOK)
    known.after(logbook_of(trip))

    after = known.after(logbook_of(trip[-1:], station=None))

    assert names(after) == {"home", "over", "shop", "farm"}


def test_only_so_many_landings_are_kept_the_newest(trip: Any) -> None:
    known = KnownLandings(NO_BOOK)

    for number in range(100):
        flight = trip[1].model_copy(update={"to_id": StationId(f"stn_{number}")})
        after = known.after(logbook_of([flight]))

    assert len(after) == 64
    assert "stn_99" in names(after)
    assert "stn_1" not in names(after)
