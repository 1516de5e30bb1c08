"""Shortest paths between stations, for the peers that ask for a matrix: plain Dijkstra."""

import heapq
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from skyway.network.network import Network


def lengths_m(network: Network, rows: Sequence[int]) -> npt.NDArray[np.float64]:
    """Metres of the shortest path from each of these rows to every station, ``(k, n)``."""
    leaving = network.outgoing
    offsets, others = leaving.offsets.tolist(), leaving.station.tolist()
    arc_lengths = leaving.length_m.tolist()
    found = np.full((len(rows), len(network.columns.station_ids)), np.inf)
    for number, row in enumerate(rows):
        settled: dict[int, float] = {}
        heap = [(0.0, row)]
        while heap:
            length_m, here = heapq.heappop(heap)
            if here in settled:
                continue
            settled[here] = length_m
            for arc in range(offsets[here], offsets[here + 1]):
                if others[arc] not in settled:
                    heapq.heappush(heap, (length_m + arc_lengths[arc], others[arc]))
        found[number, list(settled)] = list(settled.values())
    return found
