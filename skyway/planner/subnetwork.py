"""The part of the network that a search may use, and the paper's sector, which chooses one.

Notes
-----
The sector is that of Shahzaad and Bouguettaya, Algorithm 1, step 1. Its apex is the source, its
angle the smallest that holds the bearings of all destinations, its radius the distance of the
farthest. Widening it while no plan is found inside is the paper's future work.
"""

import heapq
import math
from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import count

from skyway.geo import bearing_rad, distance_m
from skyway.ids import StationId
from skyway.network.network import Network, Segment
from skyway.planner.situation import Situation

#: Each widening: radians added on both sides, and the factor of the radius. Our own choice; the
#: first is the paper's sector itself, and the whole network comes after the last.
_WIDENINGS = (
    (0.0, 1.0),
    (math.radians(15), 1.1),
    (math.radians(30), 1.25),
    (math.radians(60), 1.5),
)

#: How many sectors there are before the whole network.
WIDENINGS = len(_WIDENINGS)

#: Tolerance of the edge, in radians and as a share of the radius.
_ROUNDING = 1e-9


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


def widening_sectors(
    network: Network, apex: StationId, *, targets: Sequence[StationId], first: int = 0
) -> Iterator[Collection[StationId]]:
    """The stations of the sector, then of wider ones, then of the whole network.

    `first` is the number of the widening to begin with: 0 is the paper's own sector,
    `WIDENINGS` the whole network.
    """
    whole = network.stations
    if targets:
        angle_start, angle_width = _smallest_angle(
            [bearing_rad(whole[apex].position, whole[target].position) for target in targets]
        )
        radius_m = max(
            distance_m(whole[apex].position, whole[target].position) for target in targets
        )
        size = 0
        for added_rad, factor in _WIDENINGS[first:]:
            sector = _stations_within(
                network,
                apex,
                angle_start=angle_start - added_rad,
                angle_width=angle_width + 2 * added_rad,
                radius_m=radius_m * factor,
            )
            if size < len(sector) < len(whole):
                size = len(sector)
                yield sector
    yield whole


def _smallest_angle(bearings: Sequence[float]) -> tuple[float, float]:
    """Start and width, clockwise, of the smallest angle that holds all these bearings."""
    around = sorted(bearings)
    gaps = [
        ((after - before) % (2 * math.pi), after)
        for before, after in zip(around, around[1:] + around[:1], strict=True)
    ]
    widest_gap, start = max(gaps)
    return (start, 2 * math.pi - widest_gap) if widest_gap > 0 else (start, 0.0)


def _stations_within(
    network: Network,
    apex: StationId,
    *,
    angle_start: float,
    angle_width: float,
    radius_m: float,
) -> frozenset[StationId]:
    centre = network.stations[apex].position
    inside = {apex}
    for station_id, station in network.stations.items():
        if distance_m(centre, station.position) > radius_m * (1 + _ROUNDING):
            continue
        turn = (bearing_rad(centre, station.position) - angle_start + _ROUNDING) % (2 * math.pi)
        if turn <= angle_width + 2 * _ROUNDING:
            inside.add(station_id)
    return frozenset(inside)
