"""A made-up city: random stations, connected to near ones; the same seed gives the same city."""

import math
from random import Random

import numpy as np

from skyway.errors import InvalidInput
from skyway.geo import EARTH_RADIUS_M, Position
from skyway.ids import StationId
from skyway.network.columns import Columns, Floats
from skyway.network.components import components
from skyway.network.near_pairs import Pairs, near_pairs
from skyway.network.network import DEFAULT_PADS, MAX_PADS, Network

#: The middle of the city: the paper's San Antonio (GeoNames).
CITY_CENTRE = Position(-98.49363, 29.42412)

#: Most stations that fit around the centre at the default spacing without reaching a pole.
MAX_STATIONS = 1_000_000

# In an endless city some reach gives the degree; a slightly longer reach usually connects the city.
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

    Stations lie uniformly in a square. The shortest pairs are connected in both directions until
    the mean degree is reached, then the shortest pairs that join parts which are still apart.

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
    longitude_deg, latitude_deg = _scattered(
        stations,
        side_m=spacing_m * math.sqrt(stations),
        random=Random(seed),  # noqa: S311 - reproducible chance is the point, nothing is secret
    )
    lines = _connected(longitude_deg, latitude_deg, degree=degree, spacing_m=spacing_m)
    columns = Columns(
        station_ids=tuple(StationId(f"s{number}") for number in range(1, stations + 1)),
        longitude_deg=longitude_deg,
        latitude_deg=latitude_deg,
        pads=np.full(stations, pads, np.int32),
        from_row=np.column_stack((lines.one, lines.other)).ravel().astype(np.int32),
        to_row=np.column_stack((lines.other, lines.one)).ravel().astype(np.int32),
        length_m=np.repeat(lines.length_m, 2),
    )
    return Network.from_columns(columns)


def _check(name: str, value: float, *, low: float, high: float) -> None:
    if not low <= value <= high:
        raise InvalidInput(name, f"{value} lies outside {low:g} to {high:g}")


def _scattered(count: int, *, side_m: float, random: Random) -> tuple[Floats, Floats]:
    """Longitudes and latitudes, rounded to seven digits: a centimetre."""
    half_deg = math.degrees(side_m / 2 / EARTH_RADIUS_M)
    positions = np.empty((count, 2))
    for number in range(count):
        latitude_deg = CITY_CENTRE.latitude_deg + half_deg * (2 * random.random() - 1)
        stretch = math.cos(math.radians(latitude_deg))
        longitude_deg = CITY_CENTRE.longitude_deg + half_deg * (2 * random.random() - 1) / stretch
        positions[number] = round(longitude_deg, 7), round(latitude_deg, 7)
    return positions[:, 0].copy(), positions[:, 1].copy()


def _connected(
    longitude_deg: Floats, latitude_deg: Floats, *, degree: float, spacing_m: float
) -> Pairs:
    """The shortest pairs that give the degree, and the shortest other pairs that join all parts."""
    stations = len(longitude_deg)
    lines_of_degree = min(round(degree * stations / 2), stations * (stations - 1) // 2)
    reach_m = _REACH_SHARE * spacing_m * math.sqrt(max(degree, 1.0) / math.pi)
    pairs = near_pairs(longitude_deg, latitude_deg, reach_m=reach_m)
    while len(pairs.one) < lines_of_degree:
        reach_m *= _REACH_GROWTH
        pairs = near_pairs(longitude_deg, latitude_deg, reach_m=reach_m)
    lines, others = pairs.only(slice(lines_of_degree)), pairs.only(slice(lines_of_degree, None))
    while True:
        lines = lines.and_also(_joining(lines, others, stations=stations))
        root = components(lines.one, lines.other, stations=stations)
        if not root.any():
            return lines
        # Most stations are connected by now; the others look for pairs farther away.
        reach_m *= _REACH_GROWTH
        outside = root != np.bincount(root).argmax()
        others = near_pairs(longitude_deg, latitude_deg, reach_m=reach_m, around=outside)


def _joining(lines: Pairs, others: Pairs, *, stations: int) -> Pairs:
    """The shortest of the other pairs that join parts which the lines leave apart."""
    root = components(lines.one, lines.other, stations=stations)
    others = others.only(root[others.one] != root[others.other])
    forest = _Forest(root.tolist())
    joins = [
        forest.join(one, other)
        for one, other in zip(others.one.tolist(), others.other.tolist(), strict=True)
    ]
    return others.only(np.array(joins, np.bool_))


class _Forest:
    """Which stations are connected (union-find with path halving)."""

    def __init__(self, parents: list[int]) -> None:
        self._parents = parents

    def join(self, one: int, other: int) -> bool:
        """Join the two; whether they were apart before."""
        root, other_root = self._root(one), self._root(other)
        if root == other_root:
            return False
        self._parents[max(root, other_root)] = min(root, other_root)
        return True

    def _root(self, number: int) -> int:
        parents = self._parents
        while parents[number] != number:
            parents[number] = parents[parents[number]]
            number = parents[number]
        return number
