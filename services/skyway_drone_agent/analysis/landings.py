"""The stations that a drone knows of, and could land at."""

from dataclasses import dataclass
from typing import Final, Protocol

from skyway.contracts.flight_step import FlyStep
from skyway.geo import Position
from skyway.ids import StationId
from skyway_drone_agent.journal.current_mission import CurrentMission
from skyway_drone_agent.journal.escape import lands_on_the_spot
from skyway_drone_agent.journal.logbook import Logbook

#: So many landings are kept in mind; the ones heard of longest ago are forgotten first.
_KEPT = 64


@dataclass(frozen=True, slots=True)
class Landing:
    """A station and where it is."""

    station_id: StationId
    position: Position


def landings_of(logbook: Logbook) -> tuple[Landing, ...]:
    """Where the drone stands, and both ends of every flight of its mission, each once."""
    found: dict[StationId, Position] = {}
    if logbook.station_id is not None:
        found[logbook.station_id] = logbook.position
    if logbook.mission is not None:
        for place, flight in enumerate(_planned_flights(logbook.mission)):
            # A flight that was turned begins in the air, whatever its station is called.
            if place > 0 or logbook.mission.flown_before is None:
                found[flight.from_id] = flight.from_position
            found[flight.to_id] = flight.to_position
    return tuple(Landing(station_id, position) for station_id, position in found.items())


class LandingsAround(Protocol):
    """The stations around a flight; `edition` is another number when they are others."""

    @property
    def edition(self) -> int:
        """How often they were read."""
        ...

    def landings_along(self, flight: FlyStep) -> tuple[Landing, ...]:
        """The nearest stations along it."""
        ...

    def is_closed(self, landing: Landing) -> bool:
        """Whether nobody may land there, as far as is known."""
        ...


class LandingSource(Protocol):
    """Knows stations that are on no step of a mission."""

    def around(self, flight: FlyStep) -> LandingsAround:
        """What it knows around this flight; it may find out more."""
        ...


class NoLandings:
    """Knows no station."""

    edition = 0

    def around(self, flight: FlyStep) -> LandingsAround:
        """Nothing."""
        return self

    def landings_along(self, flight: FlyStep) -> tuple[Landing, ...]:
        """None."""
        return ()

    def is_closed(self, landing: Landing) -> bool:
        """Not that anybody knows."""
        return False


#: The book of a drone that knows no more than its missions say.
NO_LANDINGS: Final = NoLandings()


class RememberedLandings:
    """All landings of the mission so far, those its steps forget too, and those of the book."""

    __slots__ = ("_answer", "_around", "_book", "_edition", "_flight", "_known", "_seen")

    def __init__(self, book: LandingSource) -> None:
        self._book = book
        self._known: dict[StationId, Landing] = {}
        self._seen: tuple[object, object] = (None, None)
        self._flight: FlyStep | None = None
        self._around: LandingsAround | None = None
        self._edition = 0
        self._answer: tuple[Landing, ...] = ()

    def after(self, logbook: Logbook, flight: FlyStep | None = None) -> tuple[Landing, ...]:
        """The landings known once this logbook has been read too, with those along the flight."""
        steps = logbook.mission.steps if logbook.mission else None
        is_news = self._seen[0] is not steps or self._seen[1] != logbook.station_id
        if is_news or not self._known:
            self._seen = (steps, logbook.station_id)
            self._learn(logbook)
        around = self._around
        if is_news or flight is not self._flight or (around and around.edition != self._edition):
            self._look_around(flight)
        return self._answer

    def _learn(self, logbook: Logbook) -> None:
        for landing in landings_of(logbook):
            # Taken out and put back: the newest are at the end.
            self._known.pop(landing.station_id, None)
            self._known[landing.station_id] = landing
        for station_id in tuple(self._known)[:-_KEPT]:
            del self._known[station_id]
        if logbook.mission is not None:
            for step in _planned_flights(logbook.mission):
                # Asked for ahead: it takes a while to find out.
                self._book.around(step)

    def _look_around(self, flight: FlyStep | None) -> None:
        self._flight = flight
        if flight is None:
            self._around, self._answer = None, tuple(self._known.values())
            return
        around = self._around = self._book.around(flight)
        self._edition = around.edition
        found = {one.station_id: one for one in around.landings_along(flight)}
        for landing in self._known.values():
            # Where it is told to fly to it is expected, whatever was read about that before.
            if landing.station_id == flight.to_id or not around.is_closed(landing):
                found[landing.station_id] = landing
        self._answer = tuple(found.values())


def _planned_flights(mission: CurrentMission) -> list[FlyStep]:
    """The flights that end at stations: straight down is not one, the one instead of it was."""
    flights = [step for step in mission.steps if isinstance(step, FlyStep)]
    if mission.escape is not None and lands_on_the_spot(mission):
        return [mission.escape.instead_of, *flights[1:]]
    return flights
