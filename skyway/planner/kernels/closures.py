"""When a drone may fly a segment and land at a station."""

import numpy as np

from skyway.planner.kernels.compiler import kernel
from skyway.planner.kernels.memory import NONE
from skyway.planner.kernels.records import Closed, Search
from skyway.units import TIME_TOLERANCE_S, TIME_TOLERANCE_SHARE


@kernel
def slack_s(moment_s: float) -> float:
    """Moments closer than this are equal in a search: half of `skyway.units.time_tolerance_s`."""
    return (TIME_TOLERANCE_S + TIME_TOLERANCE_SHARE * abs(moment_s)) / 2.0


@kernel
def closures_of(closed: Closed, key: int) -> tuple[int, int]:
    """The range of this key's closures, empty if it has none."""
    low, high = 0, closed.keys.size
    while low < high:
        middle = (low + high) // 2
        if closed.keys[middle] < key:
            low = middle + 1
        else:
            high = middle
    if low < closed.keys.size and closed.keys[low] == key:
        return closed.offsets[low], closed.offsets[low + 1]
    return 0, 0


@kernel
def is_closed_for_good(closed: Closed, key: int) -> bool:
    """Whether this is closed from time 0 on, without end."""
    first, end = closures_of(closed, key)
    for index in range(first, end):
        if closed.start_s[index] <= 0.0 and closed.end_s[index] == np.inf:
            return True
    return False


@kernel
def open_again_s(closed: Closed, key: int, start_s: float, duration_s: float) -> float:
    """`start_s` if the time from then on meets no closure, else the end of that closure."""
    first, end = closures_of(closed, key)
    over_s = start_s + duration_s
    same_s = slack_s(over_s)
    # A landing that takes no time is a moment, and a closure covers its own first moment.
    begun_s = over_s - same_s if duration_s > 0.0 else over_s + same_s
    for index in range(first, end):
        if closed.start_s[index] < begun_s and start_s < closed.end_s[index] - same_s:
            return closed.end_s[index]
    return start_s


@kernel
def _begins_latest_s(closed: Closed, key: int, start_s: float, duration_s: float) -> float:
    """The last moment to begin before the next closure; `start_s` meets none."""
    first, end = closures_of(closed, key)
    closes_s = np.inf
    for index in range(first, end):
        if closed.end_s[index] - slack_s(start_s) > start_s:
            closes_s = min(closes_s, closed.start_s[index])
    if duration_s > 0.0 or closes_s == np.inf:
        return closes_s - duration_s
    return closes_s - 2.0 * slack_s(closes_s)


@kernel
def leave_s(
    closed: Closed,
    segment: int,
    landing: int,
    not_before_s: float,
    flight_s: float,
    stop_s: float,
) -> float:
    """The first moment to leave so that the segment, and the landing if any, meet no closure.

    `landing` and `segment` are keys, -1 for none; inf if there is no such moment.
    """
    at_s = not_before_s
    while at_s < np.inf:
        later_s = at_s
        if segment >= 0:
            later_s = open_again_s(closed, segment, at_s, flight_s)
        if later_s == at_s and landing >= 0:
            landed_s = at_s + flight_s
            open_s = open_again_s(closed, landing, landed_s, stop_s)
            if open_s > landed_s:
                later_s = open_s - flight_s
        if later_s == at_s:
            return at_s
        at_s = later_s
    return np.inf


@kernel
def leave_latest_s(
    closed: Closed, segment: int, landing: int, leave_at_s: float, flight_s: float, stop_s: float
) -> float:
    """The last moment to leave without meeting the next closure; the given moment meets none."""
    latest_s = np.inf
    if segment >= 0:
        latest_s = _begins_latest_s(closed, segment, leave_at_s, flight_s)
    if landing >= 0:
        landed_s = leave_at_s + flight_s
        latest_s = min(latest_s, _begins_latest_s(closed, landing, landed_s, stop_s) - flight_s)
    return max(latest_s, leave_at_s)


@kernel
def lands_for_free(search: Search, place: int, time_s: float) -> bool:
    """Whether landing costs nothing and no closure forbids it.

    Then a drone above the station can do all that a drone on the ground can.
    """
    task, closed = search.task, search.closed
    if task.stop_s != 0.0 or task.stop_j != 0.0:
        return False
    if closed.keys.size == 0:
        return True
    landing = closed.first_station_key + search.memory.row[place]
    return leave_latest_s(closed, NONE, landing, time_s, 0.0, 0.0) == np.inf and (
        leave_s(closed, NONE, landing, time_s, 0.0, 0.0) == time_s
    )
