"""How far it is at least between stations, along segments: for bounds, without composing."""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from skyway.ids import StationId
from skyway.network.adjacency import Adjacency
from skyway.network.columns import Floats
from skyway.network.network import Network
from skyway.planner.kernels.ways import lengths_from

#: Stations after which the search ends: what is farther is at least as far as the last of these.
_MOST_SETTLED: Final = 2_000

#: Destinations up to which all their orders are compared; of more only the farthest counts.
_MOST_ORDERED: Final = 6


def least_m_to(network: Network, end: StationId, starts: Sequence[StationId]) -> Floats:
    """The length of the shortest way to `end` from each of these stations, metres, or less.

    Closures are not looked at; inf where there is no way.
    """
    return _least_m(network, network.incoming, end, starts)


def least_tour_m(network: Network, start: StationId, stops: Sequence[StationId]) -> float:
    """The length of the shortest way from `start` through all of these, or less, metres."""
    if not stops:
        return 0.0
    from_start = _row(network, start, stops)
    if len(stops) > _MOST_ORDERED:
        return max(from_start)
    apart = [
        [0.0] * len(stops) if len(stops) == 1 else _row(network, stop, stops) for stop in stops
    ]
    # By the stops visited and the last of them: the least so far (Held and Karp).
    least = {(1 << last, last): least_m for last, least_m in enumerate(from_start)}
    for visited in range(1, 1 << len(stops)):
        for last in range(len(stops)):
            so_far_m = least.get((visited, last))
            if so_far_m is None:
                continue
            for following in range(len(stops)):
                if visited >> following & 1:
                    continue
                key = (visited | 1 << following, following)
                length_m = so_far_m + apart[last][following]
                if length_m < least.get(key, math.inf):
                    least[key] = length_m
    everything = (1 << len(stops)) - 1
    return min(least.get((everything, last), math.inf) for last in range(len(stops)))


def _row(network: Network, start: StationId, ends: Sequence[StationId]) -> list[float]:
    least_m: list[float] = _least_m(network, network.outgoing, start, ends).tolist()
    return least_m


def _least_m(
    network: Network, adjacent: Adjacency, root: StationId, wanted: Sequence[StationId]
) -> Floats:
    """The shortest ways from the root along these segments."""
    rows = np.array([network.row_of[each] for each in wanted], np.int64)
    least_m: Floats = lengths_from(
        adjacent.offsets,
        adjacent.station,
        adjacent.length_m,
        network.row_of[root],
        rows,
        _MOST_SETTLED,
    )
    return least_m
