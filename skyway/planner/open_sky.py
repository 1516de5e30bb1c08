"""The closures and zones that a verified flight must not meet, and pads within reach.

Written for `verify` alone, from docs/reference/planner-problem.md; looks at one flight at a time.
"""

import math
from collections import defaultdict
from collections.abc import Iterable
from datetime import datetime

from skyway.delivery.plan import Fly, Step
from skyway.drone.flight import flight_energy_j
from skyway.ids import StationId
from skyway.network.network import Zone
from skyway.network.zones import contains, crosses
from skyway.planner.problem import Problem
from skyway.units import TIME_TOLERANCE_S

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
        position = self._problem.network.stations[step.to_id].position
        for zone, active in self._zones:
            if _meet(touch_s, step.end_s, active) and contains(zone, position):
                return f"station {step.to_id!r} lies in zone {zone.zone_id!r}"
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
        if any(network.stations[here].pads > 0 for here in frontier):
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
