"""Which lines meet a zone, and which positions lie in it, by the array.

All of this happens in the plane of longitude and latitude: lines are straight there, and a zone is
its closed outer ring without its open holes. Lines and edges go the shorter way round the Earth.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from typing import Self

import numpy as np
import numpy.typing as npt

from skyway.geo import Position
from skyway.network.columns import Floats
from skyway.network.great_circle import beside_deg
from skyway.network.parts import Zone

#: A turn smaller than this share of its terms is computed again exactly. The share is the error
#: of three roundings on each side (Shewchuk 1997, "Adaptive precision floating-point arithmetic").
_ROUNDING_SHARE = 4 * 2.0**-52

#: The farthest from longitude 0 that a line beside its start may lie.
_FARTHEST_DEG = 360.0

#: Positions as longitudes and latitudes, ``(k,)`` each; and a corner of a zone.
Points = tuple[Floats, Floats]
Corner = tuple[float, float]
Mask = npt.NDArray[np.bool_]

#: Called again and again by work that may take long; it ends the work by raising an error.
GoOn = Callable[[], None]


def _always() -> None:
    """Let the work go on."""


def points_of(positions: Iterable[Position]) -> Points:
    """The longitudes and latitudes of these positions."""
    longitude_deg, latitude_deg = np.array([*positions], np.float64).reshape(-1, 2).T
    return longitude_deg, latitude_deg


@dataclass(frozen=True, slots=True, eq=False)
class Ring:
    """A closed ring, unrolled: its longitudes go on beyond 180 degrees where it crosses them.

    `pole_deg` is the latitude of the pole around which it goes; 0 for a ring around no pole.
    """

    corners: Points
    pole_deg: float

    @classmethod
    def of(cls, positions: Sequence[Position]) -> Self:
        """Unroll the ring of these positions."""
        longitude_deg, latitude_deg = points_of(positions)
        if (np.abs(longitude_deg) == 180.0).all():  # a band around the whole Earth
            return cls((longitude_deg, latitude_deg), 0.0)
        turns = np.concatenate(([0.0], np.cumsum(np.rint(np.diff(longitude_deg) / 360.0))))
        nearer_deg = 90.0 if latitude_deg.mean() >= 0.0 else -90.0
        corners = (longitude_deg - 360.0 * turns, latitude_deg)
        return cls(corners, nearer_deg if turns[-1] else 0.0)

    @property
    def box(self) -> tuple[float, float, float, float]:
        """West, south, east and north of what it holds; its longitudes may lie beyond 180."""
        longitude_deg, latitude_deg = self.corners
        south, north = float(latitude_deg.min()), float(latitude_deg.max())
        return (
            float(longitude_deg.min()),
            min(south, self.pole_deg) if self.pole_deg else south,
            float(longitude_deg.max()),
            max(north, self.pole_deg) if self.pole_deg else north,
        )

    def edges(self) -> Iterator[tuple[Corner, Corner]]:
        """The edges without those of length zero, unless there are no others."""
        corners = list(zip(*(each.tolist() for each in self.corners), strict=True))
        kept = [corners[0], *(end for start, end in pairwise(corners) if start != end)]
        return pairwise(kept if len(kept) > 1 else [corners[0]] * 2)


class Outline:
    """The rings of a zone, prepared for many questions."""

    def __init__(self, zone: Zone) -> None:
        self._rings = [Ring.of(ring) for ring in zone.rings]
        self.box = self._rings[0].box

    def holds(self, points: Points, *, go_on: GoOn = _always) -> Mask:
        """Whether each position lies in the zone, ``(k,)``; the zone includes its edges."""
        return self.meets(points, points, go_on=go_on)

    def meets(self, starts: Points, ends: Points, *, go_on: GoOn = _always) -> Mask:
        """Whether each straight line meets the zone, ``(k,)``; touching its edge counts."""
        lines = (starts[0], starts[1]), (beside_deg(ends[0], starts[0]), ends[1])
        meets = np.zeros(len(starts[0]), np.bool_)
        # A line that meets no edge lies on the same side of every ring as its start.
        outer, *holes = (_meets_ring(ring, *lines, meets, go_on) for ring in self._rings)
        for hole in holes:
            outer = outer & ~hole
        return meets | outer


def _meets_ring(ring: Ring, starts: Points, ends: Points, meets: Mask, go_on: GoOn) -> Mask:
    """Whether each line starts in the ring; notes in `meets` which lines meet an edge."""
    west, south, east, north = ring.box
    has_latitude = (np.maximum(starts[1], ends[1]) >= south) & (
        np.minimum(starts[1], ends[1]) <= north
    )
    westmost, eastmost = np.minimum(starts[0], ends[0]), np.maximum(starts[0], ends[0])
    inside = np.zeros(len(meets), np.bool_)
    # The whole turns that bring a line beside the ring; one more is looked at than may be needed.
    first = math.floor((west - eastmost.max(initial=-_FARTHEST_DEG)) / 360.0)
    last = math.ceil((east - westmost.min(initial=_FARTHEST_DEG)) / 360.0)
    for turn_deg in range(360 * first, 360 * last + 1, 360):
        is_near = has_latitude & (eastmost + turn_deg >= west) & (westmost + turn_deg <= east)
        rows = np.flatnonzero(is_near)
        if not len(rows):
            continue
        start = starts[0][rows] + turn_deg, starts[1][rows]
        end = ends[0][rows] + turn_deg, ends[1][rows]
        is_met, is_inside = _edge_by_edge(ring, start, end, go_on)
        meets[rows] |= is_met
        # Each edge counts once, also where the ring goes around the Earth and overlaps itself.
        inside[rows] ^= is_inside
    return inside


def _edge_by_edge(ring: Ring, start: Points, end: Points, go_on: GoOn) -> tuple[Mask, Mask]:
    """Whether each line meets an edge, and whether its start, off all edges, lies inside.

    A ray along the meridian, away from the pole that the ring holds, meets it an odd number of
    times from inside.
    """
    is_met = np.zeros(len(start[0]), np.bool_)
    is_inside = is_met.copy()
    known: tuple[Corner, Floats] | None = None
    for corner, following in ring.edges():
        go_on()
        start_turn, end_turn = _turns(corner, following, start), _turns(corner, following, end)
        # Each edge but the first begins where the one before it ends.
        corner_turn = known[1] if known and known[0] is corner else _turns(start, end, corner)
        following_turn = _turns(start, end, following)
        known = following, following_turn
        is_met |= ((corner_turn > 0) != (following_turn > 0)) & ((start_turn > 0) != (end_turn > 0))
        _note_touches(is_met, corner_turn, start, end, corner)
        _note_touches(is_met, following_turn, start, end, following)
        _note_touches(is_met, start_turn, corner, following, start)
        _note_touches(is_met, end_turn, corner, following, end)
        is_west, is_end_west = corner[0] <= start[0], following[0] <= start[0]
        is_ahead = ((start_turn < 0) == is_west) ^ (ring.pole_deg > 0.0)
        is_inside ^= (is_west != is_end_west) & is_ahead
    return is_met, is_inside


def _turns(a: Points | Corner, b: Points | Corner, c: Points | Corner) -> Floats:
    """On which side of the line a to b each c lies: left above 0, right below, exactly on it 0."""
    ahead, up, over, beside = b[0] - a[0], c[1] - a[1], b[1] - a[1], c[0] - a[0]
    left, right = ahead * up, over * beside
    turns: Floats = np.asarray(left - right)
    is_doubtful = np.abs(turns) <= _ROUNDING_SHARE * (np.abs(left) + np.abs(right))
    if is_doubtful.any():
        # A product with an exact zero is exact.
        is_exact = ((ahead == 0.0) | (up == 0.0)) & ((over == 0.0) | (beside == 0.0))
        a_x, a_y, b_x, b_y, c_x, c_y = np.broadcast_arrays(*a, *b, *c)
        for row in np.flatnonzero(is_doubtful & ~is_exact).tolist():
            turns[row] = _exact_turn(*(each.item(row) for each in (a_x, a_y, b_x, b_y, c_x, c_y)))
    return turns


def _exact_turn(*degrees: float) -> int:
    a_x, a_y, b_x, b_y, c_x, c_y = map(Fraction, degrees)
    turn = (b_x - a_x) * (c_y - a_y) - (b_y - a_y) * (c_x - a_x)
    return (turn > 0) - (turn < 0)


def _note_touches(
    is_met: Mask, turns: Floats, a: Points | Corner, b: Points | Corner, c: Points | Corner
) -> None:
    """Note where c lies on the line a to b: it turns to neither side, and lies in its box."""
    if turns.all():
        return
    is_on = turns == 0.0
    for axis in (0, 1):
        is_on &= (np.minimum(a[axis], b[axis]) <= c[axis]) & (
            c[axis] <= np.maximum(a[axis], b[axis])
        )
    is_met |= is_on
