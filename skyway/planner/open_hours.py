"""The opening hours of a problem's stations, in seconds since its start."""

import math
from datetime import timedelta

from skyway.ids import StationId
from skyway.planner.problem import Problem

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
