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
from fractions import Fraction
from itertools import pairwise
from typing import NamedTuple

from skyway.delivery.plan import Fly, Step
from skyway.drone.flight import flight_energy_j
from skyway.drone.model import DroneModel
from skyway.geo import Position
from skyway.ids import StationId
from skyway.network.network import Station, Zone
from skyway.network.pad_connectors import PAD_CONNECTORS
from skyway.planner.kernels.memory import Longs
from skyway.planner.problem import Problem
from skyway.units import TIME_TOLERANCE_S, time_tolerance_s

#: A closed time: from its start until before its end, seconds.
_Interval = tuple[float, float]

#: A line between two places: degrees east of a meridian, degrees north of the equator.
_Line = tuple[tuple[Fraction, Fraction], tuple[Fraction, Fraction]]

_HALF_TURN_DEG = 180.0
_ZERO = Fraction(0)

#: Edges farther than this from a line do not meet it; more than the rounding of degrees.
_NEAR_DEG = 1e-9


class OpenSky:
    """The closures and zones of a problem, asked about one flight or landing."""

    def __init__(self, problem: Problem, steps: Iterable[Step]) -> None:
        self._problem = problem
        self._zones = [(zone, _active_s(problem, zone)) for zone in problem.network.zones]
        flown = [step for step in steps if step.kind == "FLY"] if problem.closures else []
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
            if _meet(step.start_s, until_s, active) and meets_zone(zone, *ends):
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
            if _meet(touch_s, step.end_s, active) and meets_zone(zone, position, position):
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


def meets_zone(zone: Zone, start: Position, end: Position) -> bool:
    """Whether the straight line from start to end meets the zone; touching its edge counts.

    The search unrolls each ring, and looks on which side of lines its corners lie. Here each edge
    is placed beside the start, and the point that it shares with the line is computed.
    """
    line = _beside(start, start, end)
    lies_in = []
    for ring in zone.rings:
        is_band = all(abs(corner.longitude_deg) == _HALF_TURN_DEG for corner in ring)
        turned_deg = 0.0 if is_band else math.fsum(_east_deg(*edge) for edge in pairwise(ring))
        # A ray along the meridian of the start meets the ring; it goes away from a pole inside.
        holds_north = sum(corner.latitude_deg for corner in ring) >= 0.0
        ray = -1 if abs(turned_deg) > _HALF_TURN_DEG and holds_north else 1
        is_inside = False
        for corner, following in pairwise(ring):
            if not is_band and _is_far(start, end, corner, following):
                continue
            edge = _beside(start, corner, following, is_band=is_band)
            if any(_share_a_point(line, edge, turned=turned) for turned in (-360, 0, 360)):
                return True
            (west, south), (east, north) = edge
            if (west <= 0) != (east <= 0):
                at_meridian = south - west * (north - south) / (east - west)
                is_inside ^= (at_meridian - line[0][1]) * ray > 0
        lies_in.append(is_inside)
    return lies_in[0] and not any(lies_in[1:])


def _east_deg(start: Position, end: Position) -> float:
    """How far east of the start the end lies, the shorter way round: -180 to 180."""
    return math.remainder(end.longitude_deg - start.longitude_deg, 360.0)


def _is_far(start: Position, end: Position, corner: Position, following: Position) -> bool:
    """Whether an edge neither comes near the line nor spans the meridian of the line's start."""
    middle_deg = _east_deg(start, corner) + _east_deg(corner, following) / 2
    within_deg = abs(_east_deg(corner, following)) / 2 + _NEAR_DEG
    if abs(middle_deg) <= within_deg:
        return False
    apart_deg = math.remainder(middle_deg - _east_deg(start, end) / 2, 360.0)
    return abs(apart_deg) > within_deg + abs(_east_deg(start, end)) / 2 or (
        max(corner.latitude_deg, following.latitude_deg) < min(start.latitude_deg, end.latitude_deg)
        or min(corner.latitude_deg, following.latitude_deg)
        > max(start.latitude_deg, end.latitude_deg)
    )


def _beside(origin: Position, start: Position, end: Position, *, is_band: bool = False) -> _Line:
    """A line in exact degrees east of the origin's meridian and north of the equator."""

    def shorter(degrees: Fraction) -> Fraction:
        whole_turns = 0 if is_band else round(degrees / 360)
        return degrees - 360 * whole_turns

    from_deg, start_deg, end_deg = (Fraction(place.longitude_deg) for place in (origin, start, end))
    east = shorter(start_deg - from_deg)
    reached = east + shorter(end_deg - start_deg)
    return (east, Fraction(start.latitude_deg)), (reached, Fraction(end.latitude_deg))


def _share_a_point(line: _Line, edge: _Line, *, turned: int) -> bool:
    """Whether the line and the edge, turned east by some degrees, have a point in common."""
    (x, y), (end_x, end_y) = line
    (edge_x, edge_y), (edge_end_x, edge_end_y) = edge
    ahead_x, ahead_y, along_x, along_y = (
        end_x - x,
        end_y - y,
        edge_end_x - edge_x,
        edge_end_y - edge_y,
    )
    to_x, to_y = edge_x + turned - x, edge_y - y
    crossing = ahead_x * along_y - ahead_y * along_x
    on_line, on_edge = to_x * along_y - to_y * along_x, to_x * ahead_y - to_y * ahead_x
    if crossing:
        return 0 <= on_line / crossing <= 1 and 0 <= on_edge / crossing <= 1
    # Parallel, or without length: they meet on one line where their boxes overlap.
    return on_line == on_edge == 0 and all(
        min(to, to + along) <= max(_ZERO, ahead) and min(_ZERO, ahead) <= max(to, to + along)
        for to, along, ahead in ((to_x, along_x, ahead_x), (to_y, along_y, ahead_y))
    )


def _meet(start_s: float, end_s: float, closed: _Interval) -> bool:
    """Whether a flight or landing meets a closed time by more than the tolerance."""
    allowed_s = time_tolerance_s(end_s)
    return start_s < closed[1] - allowed_s and end_s > closed[0] + allowed_s
