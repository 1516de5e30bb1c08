"""The weather of segments: see `skyway.planner.weather`, which numbers the periods too."""

from typing import NamedTuple

import numpy as np

from skyway.planner.kernels.closures import slack_s
from skyway.planner.kernels.compiler import kernel
from skyway.planner.kernels.memory import NONE, TIME, int64
from skyway.planner.kernels.records import Search, Skyway


class Departures(NamedTuple):
    """The factors of a segment in a period, and the moments between which its flights may begin.

    An infinite time factor says that no flight begins in this period, or that an earlier period
    with the same factors has all flights of this one.
    """

    time_factor: float
    energy_factor: float
    from_s: float
    until_s: float


@kernel
def has_weather(skyway: Skyway) -> bool:
    """Whether there is any weather; without it the air is still."""
    return skyway.edges_s.size > 0


@kernel
def period_at(skyway: Skyway, at_s: float) -> int:
    """The number of the period that holds this moment."""
    return int64(np.searchsorted(skyway.edges_s, at_s, side="right"))


@kernel
def first_period(search: Search, label: int) -> int:
    """The first period in which a drone of this label may leave; periods touch one another."""
    at_s = search.memory.label[label, TIME]
    return period_at(search.skyway, max(at_s - slack_s(at_s), search.task.begin_s))


@kernel
def column_of(skyway: Skyway, segment: int) -> int:
    """The segment's row among the factors; -1 for a segment without weather."""
    if skyway.windy_segment.size == skyway.out_segment.size:
        return segment
    column = int64(np.searchsorted(skyway.windy_segment, segment))
    if column < skyway.windy_segment.size and skyway.windy_segment[column] == segment:
        return column
    return NONE


@kernel
def time_factor_of(skyway: Skyway, column: int, period: int) -> float:
    """The time factor of a segment in a period; inf where it is closed."""
    if column < 0 or period < 1 or period >= skyway.edges_s.size:
        return 1.0
    return skyway.time_factor[period - 1, column]


@kernel
def energy_factor_of(skyway: Skyway, column: int, period: int) -> float:
    """The energy factor of a segment in a period."""
    if column < 0 or period < 1 or period >= skyway.edges_s.size:
        return 1.0
    return skyway.energy_factor[period - 1, column]


@kernel
def least_time_factor(skyway: Skyway, column: int) -> float:
    """The least time factor of a segment in all periods in which the search may fly it."""
    return 1.0 if column < 0 else skyway.least_time_factor[column]


@kernel
def air_of(skyway: Skyway, column: int, period: int, first: int, flight_s: float) -> Departures:
    """The air in which flights over this segment begin in this period, and when they may.

    Periods that follow one another with the same factors count as one. This one period begins with
    `first` at the earliest. `flight_s` is the time of the flight in still air: the flight is over
    before the segment closes.
    """
    time_factor = time_factor_of(skyway, column, period)
    energy_factor = energy_factor_of(skyway, column, period)
    if period > first and _is_same(skyway, column, period - 1, time_factor, energy_factor):
        time_factor = np.inf
    if time_factor == np.inf:
        return Departures(np.inf, 1.0, np.inf, -np.inf)
    count = int64(skyway.edges_s.size)
    last = period
    while last < count and _is_same(skyway, column, last + 1, time_factor, energy_factor):
        last += 1
    from_s = skyway.edges_s[period - 1] if period > 0 else -np.inf
    until_s = skyway.edges_s[last] if last < count else np.inf
    following = last + 1
    while following <= count and skyway.edges_s[following - 1] < until_s + flight_s * time_factor:
        if time_factor_of(skyway, column, following) == np.inf:
            until_s = skyway.edges_s[following - 1] - flight_s * time_factor
            break
        following += 1
    return Departures(time_factor, energy_factor, from_s, until_s)


@kernel
def _is_same(
    skyway: Skyway, column: int, period: int, time_factor: float, energy_factor: float
) -> bool:
    return (
        time_factor_of(skyway, column, period) == time_factor
        and energy_factor_of(skyway, column, period) == energy_factor
    )
