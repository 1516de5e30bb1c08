"""The stations that a drone knows of, and could land at."""

from dataclasses import dataclass

from skyway.contracts.flight_step import FlightStep, FlyStep
from skyway.geo import Position
from skyway.ids import StationId
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
        for step in logbook.mission.steps:
            found |= _ends_of(step)
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


def _ends_of(step: FlightStep) -> dict[StationId, Position]:
    if not isinstance(step, FlyStep):
        return {}
    return {step.from_id: step.from_position, step.to_id: step.to_position}
