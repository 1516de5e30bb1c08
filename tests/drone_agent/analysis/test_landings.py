"""The stations that count as landings; a place in the air is none of them."""

from typing import Any

from skyway_drone_agent.analysis.landings import (
    NO_LANDINGS,
    Landing,
    RememberedLandings,
    landings_of,
)
from skyway_drone_agent.journal.logbook import CurrentMission, Escape, FlownBefore, Logbook
from skyway_drone_agent.journal.records import Answer

from skyway.contracts.drone_report import Failsafe, Fault
from skyway.contracts.flight_step import FlyStep
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


class Notes:
    """A landing book of one page, which counts how often it is read; it is its own surroundings."""

    def __init__(self) -> None:
        self.edition = self.readings = 0
        self.landings: tuple[Landing, ...] = ()
        self.closed: set[str] = set()
        self.asked: list[str] = []

    def around(self, flight: FlyStep) -> "Notes":
        self.asked.append(flight.to_id)
        return self

    def landings_along(self, flight: FlyStep) -> tuple[Landing, ...]:
        self.readings += 1
        return self.landings

    def is_closed(self, landing: Landing) -> bool:
        return landing.station_id in self.closed


BARN = Landing(StationId("barn"), Position(-97.95, 30.01))


def names(landings: Any) -> set[str]:
    return {landing.station_id for landing in landings}


def test_the_ends_of_all_flights_are_landings(trip: Any) -> None:
    assert names(landings_of(logbook_of(trip))) == {"home", "over", "shop", "farm"}


def test_a_flight_that_was_turned_does_not_begin_at_a_station(trip: Any) -> None:
    turned = trip[1].model_copy(update={"from_position": IN_THE_AIR})
    before = FlownBefore(since=trip[0].planned_start_at, used_j=1.0)
    logbook = logbook_of([turned], station=None, flown_before=before)

    assert names(landings_of(logbook)) == {"over"}


def test_a_landing_on_the_spot_counts_as_the_planned_landing(trip: Any) -> None:
    down = trip[1].model_copy(update={"from_position": IN_THE_AIR, "to_position": IN_THE_AIR})
    escape = Escape(fault=Fault.MOTOR_FAILURE, failsafe=Failsafe.LAND_NOW, instead_of=trip[1])
    before = FlownBefore(since=trip[0].planned_start_at, used_j=1.0)
    logbook = logbook_of([down], station=None, escape=escape, flown_before=before)

    (landing,) = landings_of(logbook)

    assert (landing.station_id, landing.position) == ("over", trip[1].to_position)


def test_passed_landings_are_remembered(trip: Any) -> None:
    known = RememberedLandings(NO_LANDINGS)
    known.after(logbook_of(trip))

    after = known.after(logbook_of(trip[-1:], station=None))

    assert names(after) == {"home", "over", "shop", "farm"}


def test_only_the_newest_landings_are_kept(trip: Any) -> None:
    known = RememberedLandings(NO_LANDINGS)

    for number in range(100):
        flight = trip[1].model_copy(update={"to_id": StationId(f"stn_{number}")})
        after = known.after(logbook_of([flight]))

    assert len(after) == 64
    assert "stn_99" in names(after)
    assert "stn_1" not in names(after)


def test_the_book_is_asked_ahead_for_all_flights_of_a_mission(trip: Any) -> None:
    book = Notes()

    RememberedLandings(book).after(logbook_of(trip))

    assert book.asked == ["over", "shop", "farm", "home"]


def test_the_book_is_read_once_for_a_flight(trip: Any) -> None:
    book, logbook = Notes(), logbook_of(trip[1:])
    book.landings = (BARN,)
    known = RememberedLandings(book)

    found = [known.after(logbook, trip[1]) for _ in range(100)]

    assert names(found[0]) == names(found[-1]) == {"home", "over", "shop", "farm", "barn"}
    assert book.readings == 1


def test_stations_read_during_a_flight_count_immediately(trip: Any) -> None:
    book, logbook = Notes(), logbook_of(trip[1:])
    known = RememberedLandings(book)
    before = names(known.after(logbook, trip[1]))

    book.landings, book.edition = (BARN,), 1

    assert "barn" not in before
    assert "barn" in names(known.after(logbook, trip[1]))


def test_on_the_ground_only_stations_of_missions_are_reported(trip: Any) -> None:
    book, logbook = Notes(), logbook_of(trip[1:])
    book.landings = (BARN,)

    assert "barn" not in names(RememberedLandings(book).after(logbook))


def test_a_closed_station_is_skipped_unless_the_flight_ends_there(
    trip: Any,
) -> None:
    book, logbook = Notes(), logbook_of(trip[1:])
    book.closed = {"home", "over"}

    assert names(RememberedLandings(book).after(logbook, trip[1])) == {"over", "shop", "farm"}
