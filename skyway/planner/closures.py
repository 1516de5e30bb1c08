"""When segments are closed to flight and stations to landing, and when stations are open.

All moments are seconds since the problem's start.
"""

import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

from skyway.ids import StationId
from skyway.network.network import Zone
from skyway.network.opening_hours import OpeningHours
from skyway.planner.airspace import Airspace, SegmentEnds
from skyway.planner.problem import Problem, StationClosure
from skyway.units import time_tolerance_s

#: From one moment to another, seconds since the start.
Interval = tuple[float, float]

#: How far opening hours are followed, seconds: two weeks. After that stations with opening hours
#: count as closed. Our own choice.
HOURS_AHEAD_S = 14 * 86_400.0


def open_hours_s(problem: Problem, station_id: StationId) -> tuple[Interval, ...]:
    """The times at which this station is open, in order; all time without opening hours.

    No time lies more than `HOURS_AHEAD_S` ahead. The problem has a `start_at`.
    """
    hours = problem.network.opening_hours.get(station_id)
    if hours is None or problem.start_at is None:
        return ((-math.inf, math.inf),)
    start_at = problem.start_at
    times = hours.open_times(start_at, start_at + timedelta(seconds=HOURS_AHEAD_S))
    return tuple(
        ((opens_at - start_at).total_seconds(), (closes_at - start_at).total_seconds())
        for opens_at, closes_at in times
    )


def closed_hours_s(problem: Problem, station_id: StationId) -> list[Interval]:
    """The times from the start on at which this station is closed; the last one has no end."""
    closed: list[Interval] = []
    closed_from_s = -math.inf
    for opens_s, closes_s in open_hours_s(problem, station_id):
        if opens_s > max(closed_from_s, 0.0):
            closed.append((closed_from_s, opens_s))
        closed_from_s = closes_s
    if closed_from_s < math.inf:
        closed.append((closed_from_s, math.inf))
    return closed


@dataclass(frozen=True, slots=True)
class Use:
    """A segment flown, or a station landed at, for some time after a departure."""

    what: SegmentEnds | StationId
    after_s: float
    duration_s: float


@dataclass(frozen=True, slots=True)
class Departure:
    """The moment to leave (infinite: never), and the closure that delays it, if any."""

    at_s: float
    because_of: SegmentEnds | StationId | None


class Closures:
    """The closed times of segments and stations: zones, opening hours and the problem's own."""

    def __init__(self, closed: Mapping[SegmentEnds | StationId, Iterable[Interval]]) -> None:
        self._closed = {what: _merged(intervals) for what, intervals in closed.items()}

    @classmethod
    def of(cls, problem: Problem, airspace: Airspace) -> "Closures":
        """The closures of this problem."""
        closed: dict[SegmentEnds | StationId, list[Interval]] = defaultdict(list)
        for reach in airspace.reaches:
            active = _active_s(reach.zone, problem.start_at)
            for station_id in reach.stations:
                closed[station_id].append(active)
            for ends in reach.segments:
                closed[ends].append(active)
        for closure in problem.closures:
            end_s = math.inf if closure.end_s is None else closure.end_s
            if isinstance(closure, StationClosure):
                closed[closure.station_id].append((closure.start_s, end_s))
            else:
                closed[closure.from_id, closure.to_id].append((closure.start_s, end_s))
        # Many stations share their hours.
        closed_by_hours: dict[OpeningHours, list[Interval]] = {}
        for station_id, hours in problem.network.opening_hours.items():
            if hours not in closed_by_hours:
                closed_by_hours[hours] = closed_hours_s(problem, station_id)
            closed[station_id].extend(closed_by_hours[hours])
        return cls(closed)

    def intervals(self) -> Mapping[SegmentEnds | StationId, tuple[Interval, ...]]:
        """All closed times."""
        return self._closed

    def is_closed_for_good(self, what: SegmentEnds | StationId) -> bool:
        """Whether this is closed from time 0 on, without end."""
        intervals = self._closed.get(what, ())
        return any(start_s <= 0 and end_s == math.inf for start_s, end_s in intervals)

    def earliest_departure(self, uses: Sequence[Use], *, not_before_s: float) -> Departure:
        """The first moment from which all these uses meet nothing closed."""
        departure = Departure(not_before_s, None)
        uses = [use for use in uses if use.what in self._closed]
        while departure.at_s < math.inf:
            later = self._next_departure(uses, departure.at_s)
            if later is None:
                return departure
            departure = later
        return departure

    def _next_departure(self, uses: Sequence[Use], at_s: float) -> Departure | None:
        """A later departure that a use needs; None when this departure is good."""
        for use in uses:
            start_s = at_s + use.after_s
            over_s = start_s + use.duration_s
            same_s = time_tolerance_s(over_s) / 2
            # A landing that takes no time is a moment; a closure covers its own first moment.
            begun_s = over_s - same_s if use.duration_s > 0 else over_s + same_s
            for closed_from_s, closed_until_s in self._closed[use.what]:
                if closed_from_s < begun_s and start_s < closed_until_s - same_s:
                    return Departure(closed_until_s - use.after_s, use.what)
        return None


def _active_s(zone: Zone, start_at: datetime | None) -> Interval:
    """When a zone is active; a problem without `start_at` has no dated zones."""

    def seconds(moment: datetime | None, unbounded_s: float) -> float:
        if moment is None or start_at is None:
            return unbounded_s
        return (moment - start_at).total_seconds()

    return seconds(zone.active_from, -math.inf), seconds(zone.active_until, math.inf)


def _merged(intervals: Iterable[Interval]) -> tuple[Interval, ...]:
    merged: list[Interval] = []
    for start_s, end_s in sorted(intervals):
        if merged and start_s <= merged[-1][1]:
            merged[-1] = (merged[-1][0], max(merged[-1][1], end_s))
        else:
            merged.append((start_s, end_s))
    return tuple(merged)
