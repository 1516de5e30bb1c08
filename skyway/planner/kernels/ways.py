"""Shortest ways from one station until all requested lengths are found (Dijkstra's method)."""

from heapq import heappop, heappush

import numpy as np

from skyway.planner.kernels.compiler import entrance
from skyway.planner.kernels.memory import Floats, Ints, Longs, int64


@entrance
def lengths_from(
    offsets: Longs, station: Ints, length_m: Floats, root: int, requested: Longs, most_settled: int
) -> Floats:
    """The length of the shortest way from the root to each requested row, or a lower bound, metres.

    The segments are those of an `Adjacency`. The search ends after `most_settled` stations:
    stations further away get the length of the last of these. inf where there is no way.
    """
    count = offsets.size - 1
    tentative_m = np.full(count, np.inf)
    is_settled = np.zeros(count, np.bool_)
    is_open = np.zeros(count, np.bool_)
    is_open[requested] = True
    still_open = is_open.sum()
    settled = 0
    radius_m = np.inf
    tentative_m[root] = 0.0
    heap = [(0.0, int64(root))]
    while len(heap) > 0 and still_open > 0:
        here_m, row = heappop(heap)
        if is_settled[row]:
            continue
        if settled >= most_settled:
            radius_m = here_m
            break
        is_settled[row] = True
        settled += 1
        still_open -= is_open[row]
        for index in range(offsets[row], offsets[row + 1]):
            other = int64(station[index])
            there_m = here_m + length_m[index]
            if there_m < tentative_m[other]:
                tentative_m[other] = there_m
                heappush(heap, (there_m, other))
    return np.where(is_settled[requested], tentative_m[requested], radius_m)
