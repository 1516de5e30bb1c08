"""The energy with which an empty drone reaches the nearest pad, as the finish demands it."""

import heapq
import math
from itertools import count

from skyway.drone.flight import flight_energy_j
from skyway.drone.model import DroneModel
from skyway.ids import StationId
from skyway.network.network import Network


def energy_to_pad_j(network: Network, model: DroneModel, start: StationId) -> float:
    """Energy of the empty flight to the nearest station with a pad, taken or not; inf if none.

    Zones, closures and the landing itself do not count (docs/reference/planner-problem.md).
    """
    # With one speed and one power the path of least energy is the shortest path.
    tie_breaker = count()
    heap = [(0.0, next(tie_breaker), start)]
    settled: set[StationId] = set()
    while heap:
        length_m, _, here = heapq.heappop(heap)
        if here in settled:
            continue
        if network.stations[here].pads > 0:
            return flight_energy_j(model, length_m=length_m, load_kg=0.0)
        settled.add(here)
        for segment in network.segments_from(here):
            if segment.to_id not in settled:
                reached_m = length_m + segment.length_m
                heapq.heappush(heap, (reached_m, next(tie_breaker), segment.to_id))
    return math.inf
