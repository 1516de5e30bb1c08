"""Obstacles of a verified plan: closures, zones, weather, and a finish far from any pad.

Written for `verify` alone, from docs/reference/planner-problem.md, so that a mistake of the search
is not repeated here. It looks at one flight at a time.
"""

import math
from bisect import bisect_left, bisect_right
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime, timedelta
from itertools import pairwise
from typing import NamedTuple

from skyway.delivery.plan import Fly, Step
from skyway.drone.flight import flight_energy_j
from skyway.drone.model import DroneModel
from skyway.ids import StationId
from skyway.network.network import Station, Zone
from skyway.network.pad_connectors import PAD_CONNECTORS
from skyway.network.zones import contains, crosses
from skyway.planner.kernels.memory import Longs
from skyway.planner.problem import Problem
from skyway.units import TIME_TOLERANCE_S, time_tolerance_s

#: A closed time: from its start until before its end, seconds.
_Interval = tuple[float, float]


class OpenSky:
    """The closures and zones of a problem, asked about one flight or landing."""

    def __init__(self, problem: Problem, steps: Iterable[Step]) -> None:
        self._problem = problem
        self._zones = [(zone, _active_s(problem, zone)) for zone in problem.network.zones]
        flown = [step for step in steps if isinstance(step, Fly)] if problem.closures else []
        used = {step.to_id for step in flown} | {(step.from_id, step.to_id) for step in flown}
        self._closed: dict[object, list[_Interval]] = defaultdict(list)
        for closure in problem.closures:
            if closure.closes in used:
                end_s = math.inf if closure.end_s is None else closure.end_s
                self._closed[closure.closes].append((closure.start_s, end_s))

    @property
    def has_obstacles(self) -> bool:
        """Whether anything may close a segment or a landing of these steps."""
        return bool(self._closed or self._zones or self._problem.network.opening_hours)

    def closed_segment(self, step: Fly, *, until_s: float) -> str | None:
        """What closes the segment at some moment of the flight, or None."""
        for closed in self._closed.get((step.from_id, step.to_id), ()):
            if _meet(step.start_s, until_s, closed):
                return f"the segment is closed from {closed[0]} s"
        stations = self._problem.network.stations
        ends = (stations[step.from_id].position, stations[step.to_id].position)
        for zone, active in self._zones:
            if _meet(step.start_s, until_s, active) and crosses(zone, *ends):
                return f"the segment crosses zone {zone.zone_id!r}"
        return None

    def closed_landing(self, step: Fly, *, touch_s: float) -> str | None:
        """What closes the station at some moment of the landing, or None."""
        for closed in self._closed.get(step.to_id, ()):
            if _meet(touch_s, step.end_s, closed):
                return f"station {step.to_id!r} is closed from {closed[0]} s"
        hours = self.closed_by_hours(step.to_id, touch_s, step.end_s)
        if hours is not None:
            return hours
        position = self._problem.network.stations[step.to_id].position
        for zone, active in self._zones:
            if _meet(touch_s, step.end_s, active) and contains(zone, position):
                return f"station {step.to_id!r} lies in zone {zone.zone_id!r}"
        return None

    def closed_by_hours(self, station_id: StationId, start_s: float, end_s: float) -> str | None:
        """The opening hours that do not cover this time, or None; the tolerance counts."""
        hours, start_at = (
            self._problem.network.opening_hours.get(station_id),
            self._problem.start_at,
        )
        if hours is None or start_at is None:
            return None
        # Day by day at the station; the search computes all times in one step.
        at_s, tolerance = start_s, timedelta(seconds=TIME_TOLERANCE_S)
        while True:
            moment = start_at + timedelta(seconds=at_s)
            day = timedelta(days=1)
            open_until_s = max(
                (
                    (closes_at - start_at).total_seconds()
                    for opens_at, closes_at in hours.open_times(moment - day, moment + day)
                    if opens_at <= moment + tolerance and moment <= closes_at + tolerance
                ),
                default=-math.inf,
            )
            if end_s <= open_until_s + TIME_TOLERANCE_S:
                return None
            if open_until_s <= at_s + TIME_TOLERANCE_S:
                return f"station {station_id!r} is not open from {at_s} s to {end_s} s"
            at_s = open_until_s


@dataclass(frozen=True, slots=True)
class AirOfFlight:
    """How many times longer a flight takes, and how much more power it needs."""

    longer: float
    harder: float


STILL = AirOfFlight(1.0, 1.0)


class FlightInAir(NamedTuple):
    """A flight without its landing: how long it takes, the energy that it uses, and its air."""

    flight_s: float
    energy_j: float
    air: AirOfFlight


class MovingAir:
    """The weather of a problem, asked about one flight."""

    def __init__(self, problem: Problem) -> None:
        self._weather = problem.weather
        self._network = problem.network
        edges_s = [] if self._weather is None else self._weather.edges_s.tolist()
        self._periods = list(pairwise([-math.inf, *edges_s, math.inf]))
        self._ends_s = [end_s for _, end_s in self._periods]

    def flight(
        self, step: Fly, still_s: float, still_j: float, *, stop_s: float, stop_j: float
    ) -> FlightInAir | None:
        """The flight in the air in which it may begin; None if the segment is closed then.

        `still_s` and `still_j` are seconds and joules in still air, `stop_s` and `stop_j` those of
        the landing. Near the edge of two periods the air counts that fits the step better. All fit
        a flight without length; then the air counts that the step states.
        """
        flights = [
            FlightInAir(still_s * air.longer, still_j * air.longer * air.harder, air)
            for (from_s, _), air in self._met(step)
            if air is not None and from_s <= step.start_s + time_tolerance_s(step.end_s)
        ]
        return min(
            flights,
            key=lambda one: (
                abs(step.end_s - step.start_s - stop_s - one.flight_s) * still_j
                + abs(step.energy_j - stop_j - one.energy_j) * still_s,
                abs(step.time_factor - one.air.longer) + abs(step.energy_factor - one.air.harder),
            ),
            default=None,
        )

    def closed_segment(self, step: Fly, *, until_s: float) -> str | None:
        """The closed period that the flight meets by more than the tolerance, or None."""
        if self._weather is None or not self._weather.closes_some:
            return None
        for closed, air in self._met(step):
            if air is None and _meet(step.start_s, until_s, closed):
                return f"the weather closes the segment from {closed[0]} s"
        return None

    def _met(self, step: Fly) -> list[tuple[_Interval, AirOfFlight | None]]:
        """The periods that the flight meets, with the air of its segment; None where it is closed.

        The periods within the tolerance count too, but none that is over when the plan starts.
        """
        if self._weather is None:
            return []
        column, allowed_s = self._column(step, self._weather.segment), time_tolerance_s(step.end_s)
        met: list[tuple[_Interval, AirOfFlight | None]] = []
        first = max(
            bisect_left(self._ends_s, step.start_s - allowed_s),
            bisect_right(self._ends_s, 0.0),
        )
        for number, period in enumerate(self._periods[first:], start=first):
            if step.end_s < period[0] - allowed_s:
                break
            air: AirOfFlight | None = STILL
            if column is not None and 0 < number < len(self._periods) - 1:
                longer = float(self._weather.time_factor[number - 1, column])
                harder = float(self._weather.energy_factor[number - 1, column])
                air = AirOfFlight(longer, harder) if math.isfinite(longer) else None
            met.append((period, air))
        return met

    def _column(self, step: Fly, named: Longs) -> int | None:
        """The number of the segment among those named; None for a segment without weather."""
        outgoing, row_of = self._network.outgoing, self._network.row_of
        leaving = outgoing.at(row_of[step.from_id])
        place = outgoing.station[leaving].tolist().index(row_of[step.to_id])
        segment = int(outgoing.segment[leaving.start + place])
        if len(named) == len(outgoing.segment):
            return segment
        left = bisect_left(named, segment)
        return left if left < len(named) and named[left] == segment else None


def is_pad_within_reach(problem: Problem, start: StationId, *, energy_j: float) -> bool:
    """Whether the empty drone reaches a station with a pad with this energy.

    Bellman and Ford, where the search uses Dijkstra: another algorithm makes other mistakes. Ways
    longer than this energy, and all after the first pad, are not followed.
    """
    network, model = problem.network, problem.drone.model
    reach_m = energy_j / flight_energy_j(model, length_m=1.0, load_kg=0.0)
    reached_m = {start: 0.0}
    frontier = {start}
    while frontier:
        if any(_has_pad_for(model, network.stations[here]) for here in frontier):
            return reach_m >= 0
        following: set[StationId] = set()
        for here in frontier:
            for segment in network.segments_from(here):
                length_m = reached_m[here] + segment.length_m
                if length_m <= reach_m and length_m < reached_m.get(segment.to_id, math.inf):
                    reached_m[segment.to_id] = length_m
                    following.add(segment.to_id)
        frontier = following
    return False


def does_fit(model: DroneModel, station: Station) -> bool:
    """Whether the pads of this station fit the drone; read from the document's own property."""
    listed = station.properties.get(PAD_CONNECTORS)
    return listed is None or model.connector is None or model.connector in listed


def _has_pad_for(model: DroneModel, station: Station) -> bool:
    return station.pads > 0 and does_fit(model, station)


def _active_s(problem: Problem, zone: Zone) -> _Interval:
    def seconds(moment: datetime | None, unbounded_s: float) -> float:
        if moment is None or problem.start_at is None:
            return unbounded_s
        return (moment - problem.start_at).total_seconds()

    return seconds(zone.active_from, -math.inf), seconds(zone.active_until, math.inf)


def _meet(start_s: float, end_s: float, closed: _Interval) -> bool:
    """Whether a flight or landing meets a closed time by more than the tolerance."""
    allowed_s = time_tolerance_s(end_s)
    return start_s < closed[1] - allowed_s and end_s > closed[0] + allowed_s
