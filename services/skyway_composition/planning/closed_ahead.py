"""Whether a landing or a segment is closed at a given time, for any reason."""

from collections import defaultdict
from collections.abc import Iterable
from copy import copy
from datetime import datetime
from math import inf
from typing import Self

from skyway.drone.learned_values import UNKNOWN_USE
from skyway.drone.model import DroneModel
from skyway.ids import StationId
from skyway.network.network import Network
from skyway.planner.airspace import ZoneReach
from skyway.planner.problem_parts import SegmentClosure, StationClosure
from skyway.planner.weather import Weather
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition.closures.network_weather import NetworkWeather
from skyway_composition.planning.world import World

#: From one moment until before another, milliseconds since 1970.
_Span = tuple[float, float]


class ClosedAhead:
    """The closures and zones of a network from a moment on; with a drone model its weather too."""

    def __init__(self, network: Network, known: NetworkWeather | None = None) -> None:
        self._network = network
        self._known = known
        self._use_deviation = UNKNOWN_USE
        self._weather: Weather | None = None
        self._stations: dict[StationId, list[_Span]] = defaultdict(list)
        self._segments: dict[tuple[StationId, StationId], list[_Span]] = defaultdict(list)

    @classmethod
    def of(cls, world: World, *, now_ms: int) -> Self:
        """All that is closed in a world, now or later; after its end a forecast closes nothing."""
        known = world.conditions.weather
        is_over = known is None or now_ms >= known.over_ms
        closed = cls(world.skyway.network, None if is_over else known)
        closed._use_deviation = world.use_deviation
        closed.add(world.conditions.problem_closures(now_ms), start_ms=now_ms)
        closed.add_zones(world.skyway.airspace.reaches)
        return closed

    def for_model(self, model: DroneModel) -> Self:
        """The same, with the segments that the weather closes for drones of this model."""
        if self._known is None:
            return self
        closed = copy(self)
        closed._weather = self._known.of_model(model, self._use_deviation)
        return closed

    def add(self, closures: Iterable[StationClosure | SegmentClosure], *, start_ms: int) -> None:
        """Add closures whose seconds count from this moment."""
        for closure in closures:
            end_ms = inf if closure.end_s is None else start_ms + closure.end_s * 1000
            span = start_ms + closure.start_s * 1000, end_ms
            if isinstance(closure, StationClosure):
                self._stations[closure.station_id].append(span)
            else:
                self._segments[closure.from_id, closure.to_id].append(span)

    def add_zones(self, reaches: Iterable[ZoneReach]) -> None:
        """Add the zones of the network."""
        for reach in reaches:
            span = _ms(reach.zone.active_from, -inf), _ms(reach.zone.active_until, inf)
            for station_id in reach.stations:
                self._stations[station_id].append(span)
            for ends in reach.segments:
                self._segments[ends].append(span)

    def closes_landing(self, station_id: StationId, at_ms: float) -> bool:
        """Whether the station is closed at that moment, or no longer exists.

        Opening hours do not count: a drone that comes late lands, and waits on the ground.
        """
        if station_id not in self._network.stations:
            return True
        spans = self._stations.get(station_id, ())
        return any(start_ms <= at_ms < end_ms for start_ms, end_ms in spans)

    def is_shut(self, station_id: StationId, at_ms: float) -> bool:
        """Whether the station is closed by its opening hours at that moment."""
        hours = self._network.opening_hours.get(station_id)
        return hours is not None and not hours.is_open(ms_to_moment(int(at_ms)))

    def closes_segment(
        self, from_id: StationId, to_id: StationId, *, start_ms: float, end_ms: float
    ) -> bool:
        """Whether the segment is closed at some moment of that time, or no longer exists."""
        if from_id not in self._network.stations or not any(
            each.to_id == to_id for each in self._network.segments_from(from_id)
        ):
            return True
        weather = self._weather
        if weather is not None and weather.closes(
            from_id, to_id, start_s=start_ms / 1000, end_s=end_ms / 1000
        ):
            return True
        spans = self._segments.get((from_id, to_id), ())
        return any(from_ms < end_ms and start_ms < until_ms for from_ms, until_ms in spans)

    def is_closed_for_good(self, station_id: StationId) -> bool:
        """Whether a station is closed without an end, or no longer exists."""
        spans = self._stations.get(station_id, ())
        exists = station_id in self._network.stations
        return not exists or any(end_ms == inf for _, end_ms in spans)


def _ms(moment: datetime | None, unknown: float) -> float:
    return unknown if moment is None else moment_to_ms(moment)
