"""All pairs of positions that are near each other, found by cells of space, and their segments."""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np
import numpy.typing as npt

from skyway.geo import EARTH_RADIUS_M
from skyway.ids import StationId
from skyway.network.columns import Floats
from skyway.network.great_circle import distances_m, unit_vectors
from skyway.network.parts import Segment, Station, Zone
from skyway.network.zones import Outline, points_of

_HALF_EARTH_M = math.pi * EARTH_RADIUS_M

#: Bits of a cell's number along one axis; three of them fit a signed 64-bit key.
_AXIS_BITS = 21

#: Candidates examined together: enough to keep NumPy busy, few enough to stay in memory.
_BLOCK = 4_000_000

Indices = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """Pairs of positions, `one` < `other` their indices, ``(k,)`` each; the shortest first."""

    length_m: Floats
    one: Indices
    other: Indices

    @classmethod
    def shortest_first(cls, length_m: Floats, one: Indices, other: Indices) -> "Pairs":
        """Sort the pairs by length, pairs of equal length by their indices."""
        order = np.lexsort((other, one, length_m))
        return cls(length_m[order], one[order], other[order])

    def only(self, which: slice | npt.NDArray[np.bool_]) -> "Pairs":
        """A part of these pairs."""
        return Pairs(self.length_m[which], self.one[which], self.other[which])

    def and_also(self, more: "Pairs") -> "Pairs":
        """These pairs, then the others."""
        return Pairs(
            np.concatenate((self.length_m, more.length_m)),
            np.concatenate((self.one, more.one)),
            np.concatenate((self.other, more.other)),
        )


def near_pairs(
    longitude_deg: Floats,
    latitude_deg: Floats,
    *,
    reach_m: float,
    around: npt.NDArray[np.bool_] | None = None,
) -> Pairs:
    """All pairs at most `reach_m` apart; with `around`, only pairs with an end in it.

    Only near positions are compared. Each position falls into a cell of space, and the positions
    in its reach lie in the same cell or in the 26 cells around it. Cells of space have neither
    poles nor a date line.
    """
    if reach_m <= 0.0:
        return Pairs(np.empty(0), np.empty(0, np.int64), np.empty(0, np.int64))
    # A little wider than the chord, so that rounding never loses a pair at the limit.
    width = 2 * math.sin(min(reach_m, _HALF_EARTH_M) / (2 * EARTH_RADIUS_M)) * (1 + 1e-9) + 1e-12
    vectors = unit_vectors(longitude_deg, latitude_deg)
    keys = _cell_keys(vectors, width=width)
    order = np.argsort(keys)
    seeks = np.ones(len(order), np.bool_) if around is None else around[order]
    ones: list[Indices] = []
    others: list[Indices] = []
    lengths: list[Floats] = []
    for low, high in _candidates(keys[order], seeks, x_y_z=vectors[order].T, width=width):
        first, second = order[low], order[high]
        one, other = np.minimum(first, second), np.maximum(first, second)
        length_m = distances_m(
            (longitude_deg[one], longitude_deg[other]), (latitude_deg[one], latitude_deg[other])
        )
        is_near = length_m <= reach_m
        ones.append(one[is_near])
        others.append(other[is_near])
        lengths.append(length_m[is_near])
    return Pairs.shortest_first(
        np.concatenate(lengths), np.concatenate(ones), np.concatenate(others)
    )


def segments_in_sight(
    stations: Mapping[StationId, Station], *, max_segment_m: float, zones: Iterable[Zone] = ()
) -> tuple[Segment, ...]:
    """The segments, in both directions, between stations that see each other.

    Two stations see each other when they are at most `max_segment_m` apart and the straight line
    between them crosses none of the zones, active or not.
    """
    in_order = list(stations)
    at = points_of(station.position for station in stations.values())
    pairs = near_pairs(*at, reach_m=max_segment_m)
    order = np.lexsort((pairs.other, pairs.one))
    one, other, length_m = pairs.one[order], pairs.other[order], pairs.length_m[order]
    sees = np.ones(len(order), np.bool_)
    for outline in map(Outline, zones):
        sees &= ~outline.meets((at[0][one], at[1][one]), (at[0][other], at[1][other]))
    rows = zip(one[sees].tolist(), other[sees].tolist(), length_m[sees].tolist(), strict=True)
    return tuple(
        Segment(in_order[start], in_order[end], length)
        for low, high, length in rows
        for start, end in ((low, high), (high, low))
    )


def _cell_keys(vectors: Floats, *, width: float) -> Indices:
    """The cell of each vector as one number; neighbours along the last axis differ by 1."""
    side = max(width, 2.0 ** (3 - _AXIS_BITS))
    # Half the axis, and one more cell on either side for the neighbours of the outermost cells.
    i, j, k = (np.floor(vectors / side).astype(np.int64) + 2 ** (_AXIS_BITS - 2)).T
    keys: Indices = ((i << _AXIS_BITS | j) << _AXIS_BITS) | k
    return keys


def _candidates(
    keys: Indices, seeks: npt.NDArray[np.bool_], *, x_y_z: Floats, width: float
) -> Iterator[tuple[Indices, Indices]]:
    """Pairs whose chord is at most `width`, each once, as indices into the sorted keys."""
    seekers = np.flatnonzero(seeks)
    for step_i, step_j in product((-1, 0, 1), repeat=2):
        # Three cells in a row have consecutive keys.
        row = keys[seekers] + (step_i << 2 * _AXIS_BITS) + (step_j << _AXIS_BITS)
        start, stop = np.searchsorted(keys, row - 1), np.searchsorted(keys, row + 1, side="right")
        upto = np.cumsum(stop - start)
        cuts = np.searchsorted(upto, np.arange(_BLOCK, upto[-1] if len(upto) else 0, _BLOCK))
        for block in map(slice, [0, *cuts], [*cuts, len(seekers)]):
            counts = stop[block] - start[block]
            seeker = np.repeat(seekers[block], counts)
            skipped = np.repeat(start[block] - (np.cumsum(counts) - counts), counts)
            found = np.arange(len(seeker)) + skipped
            once = (found < seeker) | ~seeks[found]
            seeker, found = seeker[once], found[once]
            chord_squared = sum((axis[seeker] - axis[found]) ** 2 for axis in x_y_z)
            is_near = chord_squared <= width * width
            yield seeker[is_near], found[is_near]
