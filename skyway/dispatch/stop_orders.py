"""The orders in which a trip may serve its destinations, as if every pad were free.

A trip serves its members at different moments in each order, so a bound has to look at all of them.
"""

from collections.abc import Sequence
from functools import cache
from itertools import permutations, product
from typing import Final, NamedTuple

import numpy as np

from skyway.planner.kernels.fleet_trips import NEED, SECONDS
from skyway.planner.kernels.memory import Flags, Floats, Longs

#: The most destinations whose orders are all looked at: 384 ways. Six have 46,080. Our own choice.
MOST_ORDERED: Final = 4


class StopOrders(NamedTuple):
    """Ways of a trip; no way that is left out is better than all of them.

    - `end` ``(ways,)``: the last place.
    - `least` ``(ways, 3)``: seconds, need and joules from the pickup to the end.
    - `served` ``(ways, members, 2)``: seconds and need from the pickup until the member has all its
      packages. This need includes what the drone needs then to reach the next pad.
    - `ready_s` ``(ways,)``: what the drone needs at the pickup to reach the next pad.
    """

    end: Longs
    least: Floats
    served: Floats
    ready_s: Floats


class Stops(NamedTuple):
    """The destinations of a trip, without its pickup.

    - `places` ``(k,)``, and `members`: the destinations of each member, as numbers in `places`.
    - `apart_m` ``(k + 1, k)``, from destination to destination; the last row is from the pickup.
    - `detour_m`: the same if the drone passes a pad.
    - `s_per_m`, `j_per_m` ``(2**k,)``, by the set of served destinations.
    - `stop` ``(2,)``: seconds and joules of one hand-over with its landing.
    - `escape_s` ``(k + 1,)``: the need of the empty flight to the nearest pad, the pickup's last.
    """

    places: Longs
    members: Sequence[Sequence[int]]
    apart_m: Floats
    detour_m: Floats
    s_per_m: Floats
    j_per_m: Floats
    stop: Floats
    escape_s: Floats


def orders_of(stops: Stops, *, loading_s: float, s_per_j: float) -> StopOrders:
    """All ways to serve these destinations that may be best for a plan; at most MOST_ORDERED."""
    count = len(stops.places)
    order, is_by_pad = _ways(count)
    before = np.hstack([np.full((len(order), 1), count), order[:, :-1]])
    # Between two places, of which the first one has no pad, a drone may fly by a pad.
    may_detour = stops.detour_m > stops.apart_m
    is_way = (may_detour[before, order] | ~is_by_pad).all(axis=1)
    order, before, is_by_pad = order[is_way], before[is_way], is_by_pad[is_way]
    bit = 1 << order
    loaded = np.cumsum(bit, axis=1) - bit
    away_m = np.where(is_by_pad, stops.detour_m[before, order], stops.apart_m[before, order])
    flown_s = away_m * stops.s_per_m[loaded] + stops.stop[0]
    charged_s = (away_m * stops.j_per_m[loaded] + stops.stop[1]) * s_per_j
    # What the drone needs at each place to reach the next pad, from the last place to the pickup.
    ready_s = stops.escape_s[np.hstack([before, order[:, -1:]])]
    for leg in range(count - 1, -1, -1):
        is_direct = may_detour[before[:, leg], order[:, leg]] & ~is_by_pad[:, leg]
        onward_s = np.where(is_direct, charged_s[:, leg] + ready_s[:, leg + 1], 0.0)
        ready_s[:, leg] = np.maximum(ready_s[:, leg], onward_s)
    seconds = np.cumsum(flown_s, axis=1) + loading_s
    charged_s = np.cumsum(charged_s, axis=1)
    # A drone that has charged for the way to a pad is late for all that follows.
    extra_s = np.maximum.accumulate(charged_s + ready_s[:, 1:], axis=1)
    at = np.empty((len(order), count, 2))
    rows = np.arange(len(order))[:, None]
    at[rows, order, SECONDS], at[rows, order, NEED] = seconds, seconds + extra_s
    served = np.stack(
        [at[:, each].max(axis=1, initial=loading_s) for each in stops.members], axis=1
    )
    end_s, need_s = seconds[:, -1], charged_s[:, -1]
    least = np.stack([end_s, end_s + need_s, need_s / s_per_j], axis=1)
    return _best_of(StopOrders(stops.places[order[:, -1]], least, served, ready_s[:, 0]))


@cache
def _ways(count: int) -> tuple[Longs, Flags]:
    """All orders of so many things, and before which of them the drone flies by a pad.

    Both ``(ways, count)``.
    """
    detours = product((False, True), repeat=count)
    ways = [*product(permutations(range(count)), detours)]
    return np.array([one for one, _ in ways], np.int64), np.array([each for _, each in ways])


def _best_of(found: StopOrders) -> StopOrders:
    """The ways without those that are no better than another one with the same end."""
    count = len(found.end)
    values = np.hstack([found.least, found.served.reshape(count, -1), found.ready_s[:, None]])
    is_as_good = (values[:, None] <= values).all(axis=2) & (found.end[:, None] == found.end)
    is_first = np.arange(count)[:, None] < np.arange(count)
    is_kept = ~(is_as_good & (is_first | ~is_as_good.T)).any(axis=0)
    return StopOrders(*(each[is_kept] for each in found))
