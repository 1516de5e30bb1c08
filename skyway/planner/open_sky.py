"""What a verified flight may not meet: closures and zones; and how far the nearest pad is.

Written for `verify` alone, from planner.md, and slow on purpose: it looks at one flight at a time.
"""

import math
from datetime import datetime

from skyway.delivery.plan import Fly
from skyway.drone.flight import flight_energy_j
from skyway.ids import StationId
from skyway.network.network import Zone
from skyway.network.zones import contains, crosses
from skyway.planner.problem import Problem, SegmentClosure, StationClosure
from skyway.units import TIME_TOLERANCE_S


def closed_segment(problem: Problem, step: Fly, *, until_s: float) -> str | None:
    """What closes the segment at some moment of the flight, or None."""
    stations = problem.network.stations
    ends = (stations[step.from_id].position, stations[step.to_id].position)
    for closure in problem.closures:
        if (
            isinstance(closure, SegmentClosure)
            and (closure.from_id, closure.to_id) == (step.from_id, step.to_id)
            and _meet(step.start_s, until_s, closure.start_s, closure.end_s)
        ):
            return f"the segment is closed from {closure.start_s} s"
    for zone in problem.network.zones:
        if _is_active(problem, zone, step.start_s, until_s) and crosses(zone, *ends):
            return f"the segment crosses zone {zone.zone_id!r}"
    return None


def closed_landing(problem: Problem, step: Fly, *, touch_s: float) -> str | None:
    """What closes the station at some moment of the landing, or None."""
    for closure in problem.closures:
        if (
            isinstance(closure, StationClosure)
            and closure.station_id == step.to_id
            and _meet(touch_s, step.end_s, closure.start_s, closure.end_s)
        ):
            return f"station {step.to_id!r} is closed from {closure.start_s} s"
    position = problem.network.stations[step.to_id].position
    for zone in problem.network.zones:
        if _is_active(problem, zone, touch_s, step.end_s) and contains(zone, position):
            return f"station {step.to_id!r} lies in zone {zone.zone_id!r}"
    return None


def pad_within_reach_j(problem: Problem, start: StationId) -> float:
    """Energy of the empty flight from here to the nearest station with a pad; inf if none.

    Bellman and Ford, where the search uses Dijkstra: another algorithm makes other mistakes.
    """
    network = problem.network
    reached_m = {start: 0.0}
    frontier = {start}
    while frontier:
        following: set[StationId] = set()
        for here in frontier:
            for segment in network.segments_from(here):
                length_m = reached_m[here] + segment.length_m
                if length_m < reached_m.get(segment.to_id, math.inf):
                    reached_m[segment.to_id] = length_m
                    following.add(segment.to_id)
        frontier = following
    nearest_m = min(
        (m for station_id, m in reached_m.items() if network.stations[station_id].pads > 0),
        default=math.inf,
    )
    return flight_energy_j(problem.drone.model, length_m=nearest_m, load_kg=0.0)


def _is_active(problem: Problem, zone: Zone, start_s: float, end_s: float) -> bool:
    def seconds(moment: datetime | None, unbounded_s: float) -> float:
        if moment is None or problem.start_at is None:
            return unbounded_s
        return (moment - problem.start_at).total_seconds()

    active_from_s = seconds(zone.active_from, -math.inf)
    active_until_s = seconds(zone.active_until, math.inf)
    return _meet(start_s, end_s, active_from_s, active_until_s)


def _meet(start_s: float, end_s: float, closed_from_s: float, closed_until_s: float | None) -> bool:
    """Whether a flight or landing meets a closed time by more than the tolerance."""
    until_s = math.inf if closed_until_s is None else closed_until_s
    return start_s < until_s - TIME_TOLERANCE_S and end_s > closed_from_s + TIME_TOLERANCE_S
