"""The stations that a drone knows of, and could land at."""

from dataclasses import dataclass

from skyway.contracts.flight_step import FlyStep
from skyway.geo import Position
from skyway.ids import StationId
from skyway_drone_agent.current_mission import CurrentMission
from skyway_drone_agent.escape import lands_on_the_spot
from skyway_drone_agent.logbook import Logbook

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


class KnownLandings:
    """All landings of the mission so far: those already passed too, which its steps forget."""

    __slots__ = ("_known", "_seen")

    def __init__(self) -> None:
        self._known: dict[StationId, Landing] = {}
        self._seen: tuple[object, object] = (None, None)

    def after(self, logbook: Logbook) -> tuple[Landing, ...]:
        """The landings known once this logbook has been read too."""
        steps = logbook.mission.steps if logbook.mission else None
        if self._seen[0] is not steps or self._seen[1] != logbook.station_id or not self._known:
            self._seen = (steps, logbook.station_id)
            for landing in landings_of(logbook):
                # Taken out and put back: the newest are at the end.
                self._known.pop(landing.station_id, None)
                self._known[landing.station_id] = landing
            for station_id in tuple(self._known)[:-_KEPT]:
                del self._known[station_id]
        return tuple(self._known.values())


def _planned_flights(mission: CurrentMission) -> list[FlyStep]:
    """The flights that end at stations: straight down is not one, the one instead of it was."""
    flights = [step for step in mission.steps if isinstance(step, FlyStep)]
    if mission.escape is not None and lands_on_the_spot(mission):
        return [mission.escape.instead_of, *flights[1:]]
    return flights
