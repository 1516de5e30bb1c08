"""Obstacles of a verified plan: reserved pads, closures, zones, and a finish far from any pad.

Written for `verify` alone, from docs/reference/planner-problem.md, so that a mistake of the search
is not repeated here. It looks at one session or flight at a time.
"""

import math
from bisect import bisect_left, bisect_right
from collections import defaultdict
from collections.abc import Iterable, Sequence, Set
from dataclasses import dataclass
from datetime import datetime, timedelta
from itertools import pairwise
from typing import TYPE_CHECKING

from skyway.delivery.plan import Fly, Recharge, Step
from skyway.drone.flight import flight_energy_j
from skyway.drone.model import DroneModel
from skyway.ids import StationId
from skyway.network.network import Station, Zone
from skyway.network.pad_connectors import PAD_CONNECTORS
from skyway.network.zones import contains, crosses
from skyway.planner.kernels.memory import Longs
from skyway.planner.problem import Problem
from skyway.planner.reservations import reservations_at
from skyway.units import TIME_TOLERANCE_S

if TYPE_CHECKING:
    from skyway.planner.pad_book import PadBook

_MS_PER_S = 1000
_MS_TOLERANCE = TIME_TOLERANCE_S * _MS_PER_S


class HeldPads:
    """The reservations of these stations: the problem's own, and the booked ones."""

    def __init__(
        self, problem: Problem, stations: Set[StationId], *, booked: "PadBook | None"
    ) -> None:
        self._held_ms: dict[tuple[StationId, int], list[tuple[float, float]]] = defaultdict(list)
        for reservation in reservations_at(problem.pad_reservations, stations):
            end_s = math.inf if reservation.end_s is None else reservation.end_s
            self._held_ms[reservation.station_id, reservation.pad].append(
                _outward_ms(reservation.start_s, end_s)
            )
        self._row_of = problem.network.row_of
        self._booked = booked

    def clash(self, session: Recharge) -> tuple[float, float] | None:
        """The milliseconds of a reservation that this session overlaps, or None."""
        start_ms, end_ms = _outward_ms(session.start_s, session.end_s)
        for other_start_ms, other_end_ms in self._held_ms.get(
            (session.station_id, session.pad), ()
        ):
            if start_ms < other_end_ms and other_start_ms < end_ms:
                return other_start_ms, other_end_ms
        row = self._row_of.get(session.station_id)
        if self._booked is None or row is None:
            return None
        for pad, other_start_ms, other_end_ms in self._booked.at(
            row, from_ms=start_ms, until_ms=end_ms
        ):
            if pad == session.pad:
                return other_start_ms, other_end_ms
        return None


def _outward_ms(start_s: float, end_s: float) -> tuple[float, float]:
    """The span of whole milliseconds around this time, despite rounding of floats."""
    start_ms, end_ms = start_s * _MS_PER_S, end_s * _MS_PER_S
    return (
        math.floor(start_ms + _MS_TOLERANCE + math.ulp(start_ms)),
        end_ms if end_ms == math.inf else math.ceil(end_ms - _MS_TOLERANCE - math.ulp(end_ms)),
    )


#: A closed time: from its start until before its end, seconds.
_Interval = tuple[float, float]


class OpenSky:
    """The closures and zones of a problem, asked about one flight or landing."""

    def __init__(self, problem: Problem, steps: Iterable[Step]) -> None:
        self._problem = problem
        self._zones = [(zone, _active_s(problem, zone)) for zone in problem.network.zones]
        flown = [step for step in steps if isinstance(step, Fly)]
        used = {step.to_id for step in flown} | {(step.from_id, step.to_id) for step in flown}
        self._closed: dict[object, list[_Interval]] = defaultdict(list)
        for closure in problem.closures:
            if closure.closes in used:
                end_s = math.inf if closure.end_s is None else closure.end_s
                self._closed[closure.closes].append((closure.start_s, end_s))

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


_STILL = AirOfFlight(1.0, 1.0)
_ALWAYS: _Interval = (-math.inf, math.inf)


class MovingAir:
    """The weather of a problem, asked about one flight."""

    def __init__(self, problem: Problem) -> None:
        self._weather = problem.weather
        self._network = problem.network
        edges_s = [] if self._weather is None else self._weather.edges_s.tolist()
        self._periods = list(pairwise([-math.inf, *edges_s, math.inf]))
        self._ends_s = [end_s for _, end_s in self._periods]

    def of_flight(self, step: Fly) -> list[tuple[_Interval, AirOfFlight | None]]:
        """The periods that the flight meets, with the air of its segment; None where it is closed.

        The periods within the tolerance count too, but none that is over when the plan starts.
        """
        if self._weather is None:
            return [(_ALWAYS, _STILL)]
        column = self._column(step, self._weather.segment)
        met: list[tuple[_Interval, AirOfFlight | None]] = []
        first = max(
            bisect_left(self._ends_s, step.start_s - TIME_TOLERANCE_S),
            bisect_right(self._ends_s, 0.0),
        )
        for number, period in enumerate(self._periods[first:], start=first):
            if step.end_s < period[0] - TIME_TOLERANCE_S:
                break
            air: AirOfFlight | None = _STILL
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


def air_at_start(
    step: Fly, met: Sequence[tuple[_Interval, AirOfFlight | None]]
) -> list[AirOfFlight]:
    """The air in which the flight may begin, none if the segment is closed then."""
    return [
        air
        for (from_s, _), air in met
        if air is not None and from_s <= step.start_s + TIME_TOLERANCE_S
    ]


def closed_by_weather(
    step: Fly, met: Sequence[tuple[_Interval, AirOfFlight | None]], *, until_s: float
) -> str | None:
    """The closed period that the flight meets by more than the tolerance, or None."""
    for closed, air in met:
        if air is None and _meet(step.start_s, until_s, closed):
            return f"the weather closes the segment from {closed[0]} s"
    return None


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
    closed_from_s, closed_until_s = closed
    return start_s < closed_until_s - TIME_TOLERANCE_S and end_s > closed_from_s + TIME_TOLERANCE_S
