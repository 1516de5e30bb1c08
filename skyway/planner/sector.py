"""The paper's sector: the area that holds the lines of sight to all destinations.

Notes
-----
Shahzaad and Bouguettaya, Algorithm 1, step 1. Its apex is the source, its angle the smallest that
holds the bearings of all destinations, its radius the distance of the farthest. Widening it while
no plan is found inside is the paper's future work.
"""

import math
from collections.abc import Collection, Iterator, Sequence

from skyway.geo import bearing_rad, distance_m
from skyway.ids import StationId
from skyway.network.network import Network

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
