"""The part of the network that a search may use: some stations, the segments between them."""

import heapq
from collections import defaultdict
from collections.abc import Collection, Mapping
from itertools import count

from skyway.ids import StationId
from skyway.network.network import Segment
from skyway.planner.situation import Situation


class Subnetwork:
    """Stations and the segments between them that are not closed for good."""

    def __init__(self, situation: Situation, stations: Collection[StationId]) -> None:
        closures = situation.closures
        self.stations = stations
        self._leaving: dict[StationId, tuple[Segment, ...]] = {}
        self._arriving: dict[StationId, list[Segment]] = defaultdict(list)
        self._lengths_to: dict[StationId, Mapping[StationId, float]] = {}
        for station_id in stations:
            leaving = tuple(
                segment
                for segment in situation.network.segments_from(station_id)
                if segment.to_id in stations
                and not closures.is_closed_for_good((station_id, segment.to_id))
            )
            self._leaving[station_id] = leaving
            for segment in leaving:
                self._arriving[segment.to_id].append(segment)

    @classmethod
    def whole(cls, situation: Situation) -> "Subnetwork":
        """All stations of the network."""
        return cls(situation, situation.network.stations)

    def segments_from(self, station_id: StationId) -> tuple[Segment, ...]:
        """The segments that leave this station, in the order of the document."""
        return self._leaving.get(station_id, ())

    def lengths_to_m(self, target: StationId) -> Mapping[StationId, float]:
        """The length of the shortest path to this target from every station that has a path.

        A reverse shortest-path tree (Dijkstra), grown when first asked for.
        """
        lengths = self._lengths_to.get(target)
        if lengths is None:
            lengths = self._lengths_to[target] = self._grow_tree(target)
        return lengths

    def _grow_tree(self, target: StationId) -> Mapping[StationId, float]:
        settled: dict[StationId, float] = {}
        best = {target: 0.0}
        tie_breaker = count()
        heap = [(0.0, next(tie_breaker), target)]
        while heap:
            length_m, _, here = heapq.heappop(heap)
            if here in settled:
                continue
            settled[here] = length_m
            for segment in self._arriving.get(here, ()):
                before, longer_m = segment.from_id, length_m + segment.length_m
                if before not in settled and longer_m < best.get(before, float("inf")):
                    best[before] = longer_m
                    heapq.heappush(heap, (longer_m, next(tie_breaker), before))
        return settled
