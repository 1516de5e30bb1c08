"""The stations where a drone could land."""

from dataclasses import dataclass
from typing import Final, Protocol

from skyway.contracts.flight_step import FlyStep
from skyway.geo import Position
from skyway.ids import StationId
from skyway_drone_agent.journal.logbook import CurrentMission, Logbook
from skyway_drone_agent.journal.mission_changes import lands_on_the_spot

#: Number of landings that are remembered; the oldest are dropped first.
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
            # A turned flight begins in the air, although it names a station as its start.
            if place > 0 or logbook.mission.flown_before is None:
                found[flight.from_id] = flight.from_position
            found[flight.to_id] = flight.to_position
    return tuple(Landing(station_id, position) for station_id, position in found.items())


class LandingsAround(Protocol):
    """The stations around a flight; `edition` changes when the stations change."""

    @property
    def edition(self) -> int:
        """How often the stations were read."""
        ...

    def landings_along(self, flight: FlyStep) -> tuple[Landing, ...]:
        """The nearest stations along the flight."""
        ...

    def is_closed(self, landing: Landing) -> bool:
        """Whether the station was closed when it was last read."""
        ...


class LandingSource(Protocol):
    """Provides stations that are in no step of a mission."""

    def around(self, flight: FlyStep) -> LandingsAround:
        """The stations around this flight; the source may read more of them later."""
        ...


class NoLandings:
    """A source without stations."""

    edition = 0

    def around(self, flight: FlyStep) -> LandingsAround:
        """No stations."""
        return self

    def landings_along(self, flight: FlyStep) -> tuple[Landing, ...]:
        """No landings."""
        return ()

    def is_closed(self, landing: Landing) -> bool:
        """Never: nothing was read."""
        return False


#: The source of a drone that uses only the stations of its missions.
NO_LANDINGS: Final = NoLandings()


class RememberedLandings:
    """The landings of all steps so far, and those of the source."""

    __slots__ = ("_answer", "_around", "_book", "_edition", "_flight", "_landings", "_seen")

    def __init__(self, book: LandingSource) -> None:
        self._book = book
        self._landings: dict[StationId, Landing] = {}
        self._seen: tuple[object, object] = (None, None)
        self._flight: FlyStep | None = None
        self._around: LandingsAround | None = None
        self._edition = 0
        self._answer: tuple[Landing, ...] = ()

    def after(self, logbook: Logbook, flight: FlyStep | None = None) -> tuple[Landing, ...]:
        """The landings after reading this logbook too, with those along the flight."""
        steps = logbook.mission.steps if logbook.mission else None
        is_news = self._seen[0] is not steps or self._seen[1] != logbook.station_id
        if is_news or not self._landings:
            self._seen = (steps, logbook.station_id)
            self._learn(logbook)
        around = self._around
        if is_news or flight is not self._flight or (around and around.edition != self._edition):
            self._look_around(flight)
        return self._answer

    def _learn(self, logbook: Logbook) -> None:
        for landing in landings_of(logbook):
            # Removed and added again, so that the newest are at the end.
            self._landings.pop(landing.station_id, None)
            self._landings[landing.station_id] = landing
        for station_id in tuple(self._landings)[:-_KEPT]:
            del self._landings[station_id]
        if logbook.mission is not None:
            for step in _planned_flights(logbook.mission):
                # Asked for ahead of time, because reading stations takes a while.
                self._book.around(step)

    def _look_around(self, flight: FlyStep | None) -> None:
        self._flight = flight
        if flight is None:
            self._around, self._answer = None, tuple(self._landings.values())
            return
        around = self._around = self._book.around(flight)
        self._edition = around.edition
        found = {one.station_id: one for one in around.landings_along(flight)}
        for landing in self._landings.values():
            # The end of the flight counts even if it was closed when it was read.
            if landing.station_id == flight.to_id or not around.is_closed(landing):
                found[landing.station_id] = landing
        self._answer = tuple(found.values())


def _planned_flights(mission: CurrentMission) -> list[FlyStep]:
    """The flights that end at stations; a landing on the spot counts as the planned flight."""
    flights = [step for step in mission.steps if isinstance(step, FlyStep)]
    if mission.escape is not None and lands_on_the_spot(mission):
        return [mission.escape.instead_of, *flights[1:]]
    return flights
