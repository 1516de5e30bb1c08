"""The windows of a situation as the arrays that the kernels read."""

import math
from typing import NamedTuple

import numpy as np

from skyway.planner.exact_bounds import Bound, Legs
from skyway.planner.kernels.bounds import fill_floors
from skyway.planner.kernels.memory import Floats, Longs
from skyway.planner.situation import Situation
from skyway.units import TIME_TOLERANCE_S

#: Seconds by which the search may miss a window: half of what `verify` allows.
_TOLERANCE_S = TIME_TOLERANCE_S / 2


class WindowRows(NamedTuple):
    """The windows by destination, then the pick-up; see `Task`."""

    start_offsets: Longs
    start_from_s: Floats
    start_until_s: Floats
    last_start_s: Floats
    floor_s: Floats
    least_s_per_m: Floats


_WITHOUT = WindowRows(
    np.zeros(0, np.int64), np.zeros(0), np.zeros(0), np.zeros(0), np.zeros(0), np.zeros(0)
)


def windows_of(
    situation: Situation, legs: Legs, flight: Bound, *, loading_s: float, apart_m: Floats
) -> WindowRows:
    """The windows, and the bounds that follow from them; empty arrays without windows.

    Parameters
    ----------
    flight
        The bound by flight time alone.
    loading_s
        Seconds of loading, with the hand-over of packages for the source.
    apart_m
        As in `bounds_of`.
    """
    if not situation.windows.may_pass:
        return _WITHOUT
    places = (*situation.destinations, situation.problem.source)
    starts = [situation.windows.starts_at(place) for place in places]
    times_s = np.array([one for each in starts for one in each], np.float64).reshape(-1, 2)
    first_s = np.array([max(0.0, each[0][0]) if each else math.inf for each in starts])
    last_s = np.array([each[-1][1] + _TOLERANCE_S if each else -math.inf for each in starts])
    least_s_per_m = _least_from_here(legs.s_per_m)
    for number, last_start_s in enumerate(last_s[:-1]):
        if last_start_s < math.inf:
            onward_s = loading_s + apart_m[-1, number] * least_s_per_m[0]
            last_s[-1] = min(last_s[-1], last_start_s - onward_s)
    floor_s = np.empty(len(legs.s_per_m))
    fill_floors(flight.after, first_s[:-1], floor_s)
    floor_s[-1] = max(first_s[-1] + loading_s + flight.least, floor_s[0])
    return WindowRows(
        np.cumsum([0, *(len(each) for each in starts)], dtype=np.int64),
        np.ascontiguousarray(times_s[:, 0]),
        np.ascontiguousarray(times_s[:, 1]) + _TOLERANCE_S,
        last_s,
        floor_s,
        least_s_per_m,
    )


def _least_from_here(s_per_m: Floats) -> Floats:
    """The least seconds per metre by mask, now and after any of the deliveries still to come."""
    least = s_per_m.copy()
    masks = np.arange(len(s_per_m) - 1)
    for bit in range(len(masks).bit_length() - 1):
        without = masks[masks >> bit & 1 == 0]
        least[without] = np.minimum(least[without], least[without | 1 << bit])
    least[-1] = min(s_per_m[-1], least[0])
    return least
