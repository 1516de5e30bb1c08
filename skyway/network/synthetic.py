"""A made-up city: stations scattered at random, near ones connected, the same for the same seed."""

import math
from collections.abc import Iterable
from random import Random

from skyway.errors import InvalidInput
from skyway.geo import EARTH_RADIUS_M, Position
from skyway.ids import StationId
from skyway.network.line_of_sight import both_ways, pairs_within
from skyway.network.network import DEFAULT_PADS, MAX_PADS, Network, Station

#: The middle of the city: the paper's San Antonio (GeoNames).
CITY_CENTRE = Position(-98.49363, 29.42412)

#: Most stations that fit around the centre at the default spacing without reaching a pole.
MAX_STATIONS = 1_000_000

# A reach somewhat over the one that gives the degree in an endless city mostly connects it, too.
_REACH_SHARE = 1.6
_REACH_GROWTH = 1.6


def synthetic_city(
    *,
    stations: int,
    seed: int,
    pads: int = DEFAULT_PADS,
    degree: float = 6.0,
    spacing_m: float = 3_000.0,
) -> Network:
    """A connected geometric random network, called `s1`, `s2`, ...; the same for the same seed.

    Stations lie uniformly in a square. The shortest pairs are connected, in both directions, as
    many as give the mean degree; then the shortest that join what is still apart.

    Parameters
    ----------
    pads
        Of every station.
    degree
        Mean number of segments that leave a station, before joining.
    spacing_m
        Side of the square's share of one station: the square's side is
        ``spacing_m * sqrt(stations)``.

    Raises
    ------
    InvalidInput
        A number lies outside its limits.
    """
    _check("stations", stations, low=1, high=MAX_STATIONS)
    _check("pads", pads, low=0, high=MAX_PADS)
    _check("degree", degree, low=0.0, high=1_000.0)
    _check("spacing_m", spacing_m, low=1.0, high=10_000.0)
    positions = _scattered(stations, side_m=spacing_m * math.sqrt(stations), random=Random(seed))  # noqa: S311 - reproducible chance is the point, nothing is secret
    in_order = [
        Station(StationId(f"s{number}"), position, pads)
        for number, position in enumerate(positions, start=1)
    ]
    lines = (
        (in_order[a], in_order[b], length_m)
        for length_m, a, b in _connected(positions, degree=degree, spacing_m=spacing_m)
    )
    return Network({station.station_id: station for station in in_order}, both_ways(lines))


def _check(name: str, value: float, *, low: float, high: float) -> None:
    if not low <= value <= high:
        raise InvalidInput(name, f"{value} lies outside {low:g} to {high:g}")


def _scattered(count: int, *, side_m: float, random: Random) -> list[Position]:
    half_deg = math.degrees(side_m / 2 / EARTH_RADIUS_M)
    positions = []
    for _ in range(count):
        latitude_deg = CITY_CENTRE.latitude_deg + half_deg * (2 * random.random() - 1)
        stretch = math.cos(math.radians(latitude_deg))
        longitude_deg = CITY_CENTRE.longitude_deg + half_deg * (2 * random.random() - 1) / stretch
        positions.append(Position(round(longitude_deg, 7), round(latitude_deg, 7)))
    return positions


def _connected(
    positions: list[Position], *, degree: float, spacing_m: float
) -> list[tuple[float, int, int]]:
    """The shortest pairs that give the degree, and the shortest others that join all."""
    all_pairs = len(positions) * (len(positions) - 1) // 2
    wanted = min(round(degree * len(positions) / 2), all_pairs)
    reach_m = _REACH_SHARE * spacing_m * math.sqrt(max(degree, 1.0) / math.pi)
    while True:
        pairs = sorted(pairs_within(positions, reach_m=reach_m))
        forest = _Forest(len(positions))
        forest.join_all(pairs[:wanted])
        joining = [pair for pair in pairs[wanted:] if forest.join(pair[1], pair[2])]
        if len(pairs) >= wanted and forest.trees == 1:
            return pairs[:wanted] + joining
        reach_m *= _REACH_GROWTH


class _Forest:
    """Which stations are connected already (union-find with path halving)."""

    def __init__(self, size: int) -> None:
        self._parents = list(range(size))
        self.trees = size

    def join_all(self, pairs: Iterable[tuple[float, int, int]]) -> None:
        for _, one, other in pairs:
            self.join(one, other)

    def join(self, one: int, other: int) -> bool:
        """Whether the two were apart; now they are not."""
        root, other_root = self._root(one), self._root(other)
        if root == other_root:
            return False
        self._parents[max(root, other_root)] = min(root, other_root)
        self.trees -= 1
        return True

    def _root(self, number: int) -> int:
        parents = self._parents
        while parents[number] != number:
            parents[number] = parents[parents[number]]
            number = parents[number]
        return number
