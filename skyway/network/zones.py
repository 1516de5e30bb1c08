"""Which lines meet a zone, and which positions lie in it: one by one, and by the array.

All of this happens in the plane of longitude and latitude: lines are straight there, and a zone is
its closed outer ring without its open holes. A zone across the antimeridian has to be cut into two.

The functions for arrays compute the same sums in the same order, so they give the same answers.
Where rounding leaves a doubt, they ask the function for one position. Their callers have left out
the positions and lines outside the box of the zone.
"""

from collections.abc import Callable, Iterator
from fractions import Fraction
from itertools import chain, pairwise

import numpy as np
import numpy.typing as npt

from skyway.geo import Position
from skyway.network.columns import Floats
from skyway.network.parts import Zone

#: A turn smaller than this share of its terms is computed again exactly. The share is the error
#: of three roundings on each side (Shewchuk 1997, "Adaptive precision floating-point arithmetic").
_ROUNDING_SHARE = 4 * 2.0**-52


#: Positions as longitudes and latitudes, ``(k,)`` each; a corner of a zone has single numbers.
Points = tuple[Floats, Floats]
Mask = npt.NDArray[np.bool_]

#: Called again and again by work that may take long; it ends the work by raising an error.
GoOn = Callable[[], None]


def _always() -> None:
    """Let the work go on."""


def crosses(zone: Zone, start: Position, end: Position) -> bool:
    """Whether the straight line from start to end meets the zone; touching its edge counts."""
    south_west, north_east = zone.box
    if (
        max(start.longitude_deg, end.longitude_deg) < south_west.longitude_deg
        or min(start.longitude_deg, end.longitude_deg) > north_east.longitude_deg
        or max(start.latitude_deg, end.latitude_deg) < south_west.latitude_deg
        or min(start.latitude_deg, end.latitude_deg) > north_east.latitude_deg
    ):
        return False
    if any(_meet(start, end, *edge) for edge in _edges(zone)):
        return True
    # The line meets no edge, so all of it lies on the same side of every ring as its start.
    return contains(zone, start)


def contains(zone: Zone, position: Position) -> bool:
    """Whether the position lies in the zone; the zone includes its edges, also around holes."""
    south_west, north_east = zone.box
    if not (
        south_west.longitude_deg <= position.longitude_deg <= north_east.longitude_deg
        and south_west.latitude_deg <= position.latitude_deg <= north_east.latitude_deg
    ):
        return False
    if any(_turn(*edge, position) == 0 and _in_box(*edge, position) for edge in _edges(zone)):
        return True
    outer, *holes = zone.rings
    return _is_inside(outer, position) and not any(_is_inside(hole, position) for hole in holes)


def which_lie_in(zone: Zone, points: Points, *, go_on: GoOn = _always) -> Mask:
    """Whether each position lies in the zone, ``(k,)``; the zone includes its edges."""
    inside, doubtful = _in_rings(zone, points, go_on)
    for index in np.flatnonzero(doubtful).tolist():
        go_on()
        inside[index] = contains(zone, _position(points, index))
    return inside


def which_cross(zone: Zone, starts: Points, ends: Points, *, go_on: GoOn = _always) -> Mask:
    """Whether each straight line meets the zone, ``(k,)``; touching its edge counts."""
    # A line that meets no edge lies on the same side of every ring as its start.
    meets, doubtful = _in_rings(zone, starts, go_on)
    for start, end in chain.from_iterable(map(_edge_arrays, zone.rings)):
        go_on()
        turn_start, start_doubtful = _turns(starts, ends, start)
        turn_end, end_doubtful = _turns(starts, ends, end)
        from_edge, from_doubtful = _turns(start, end, starts)
        to_edge, to_doubtful = _turns(start, end, ends)
        meets |= (turn_start != turn_end) & (from_edge != to_edge)
        doubtful |= start_doubtful | end_doubtful | from_doubtful | to_doubtful
    for index in np.flatnonzero(doubtful).tolist():
        go_on()
        meets[index] = crosses(zone, _position(starts, index), _position(ends, index))
    return meets


def _edges(zone: Zone) -> Iterator[tuple[Position, Position]]:
    for ring in zone.rings:
        yield from pairwise(ring)


def _is_inside(ring: tuple[Position, ...], position: Position) -> bool:
    """Whether a position off the ring lies inside: a ray north meets it an odd number of times."""
    is_inside = False
    for start, end in pairwise(ring):
        is_west, is_end_west = (
            corner.longitude_deg <= position.longitude_deg for corner in (start, end)
        )
        if is_west != is_end_west and (_turn(start, end, position) < 0) == is_west:
            is_inside = not is_inside
    return is_inside


def _meet(a: Position, b: Position, c: Position, d: Position) -> bool:
    """Whether the closed lines a to b and c to d have a point in common."""
    turn_c, turn_d = _turn(a, b, c), _turn(a, b, d)
    turn_a, turn_b = _turn(c, d, a), _turn(c, d, b)
    if turn_c * turn_d < 0 and turn_a * turn_b < 0:
        return True
    return (
        (turn_c == 0 and _in_box(a, b, c))
        or (turn_d == 0 and _in_box(a, b, d))
        or (turn_a == 0 and _in_box(c, d, a))
        or (turn_b == 0 and _in_box(c, d, b))
    )


def _turn(a: Position, b: Position, c: Position) -> int:
    """On which side of the line a to b the position c lies: 1 left, -1 right, 0 exactly on it."""
    left = (b.longitude_deg - a.longitude_deg) * (c.latitude_deg - a.latitude_deg)
    right = (b.latitude_deg - a.latitude_deg) * (c.longitude_deg - a.longitude_deg)
    turn = left - right
    if abs(turn) > _ROUNDING_SHARE * (abs(left) + abs(right)):
        return 1 if turn > 0 else -1
    a_x, a_y, b_x, b_y, c_x, c_y = map(Fraction, (*a, *b, *c))
    exact = (b_x - a_x) * (c_y - a_y) - (b_y - a_y) * (c_x - a_x)
    return (exact > 0) - (exact < 0)


def _in_box(a: Position, b: Position, c: Position) -> bool:
    """Whether c lies in the box that a and b span."""
    return min(a.longitude_deg, b.longitude_deg) <= c.longitude_deg <= max(
        a.longitude_deg, b.longitude_deg
    ) and min(a.latitude_deg, b.latitude_deg) <= c.latitude_deg <= max(
        a.latitude_deg, b.latitude_deg
    )


def _in_rings(zone: Zone, points: Points, go_on: GoOn) -> tuple[Mask, Mask]:
    """Whether each position lies in the outer ring and in no hole; where rounding leaves doubt."""
    longitude_deg = points[0]
    doubtful = np.zeros(len(longitude_deg), np.bool_)
    in_ring = []
    for ring in zone.rings:
        is_inside = np.zeros(len(longitude_deg), np.bool_)
        for start, end in _edge_arrays(ring):
            go_on()
            is_left, is_doubtful = _turns(start, end, points)
            doubtful |= is_doubtful
            is_west, is_end_west = start[0] <= longitude_deg, end[0] <= longitude_deg
            is_inside ^= (is_west != is_end_west) & (~is_left == is_west)
        in_ring.append(is_inside)
    outer, *holes = in_ring
    for hole in holes:
        outer = outer & ~hole
    return outer, doubtful


def _turns(a: Points, b: Points, c: Points) -> tuple[Mask, Mask]:
    """Whether c lies left of the line a to b, and whether rounding leaves this in doubt."""
    left = (b[0] - a[0]) * (c[1] - a[1])
    right = (b[1] - a[1]) * (c[0] - a[0])
    turn = left - right
    return turn > 0, ~(np.abs(turn) > _ROUNDING_SHARE * (np.abs(left) + np.abs(right)))


def _edge_arrays(ring: tuple[Position, ...]) -> list[tuple[Points, Points]]:
    """The ring's edges without those of length zero, unless there are no others."""
    edges = [(start, end) for start, end in pairwise(ring) if start != end] or [(ring[0], ring[1])]
    return [(_corner(start), _corner(end)) for start, end in edges]


def _corner(position: Position) -> Points:
    return np.array(position.longitude_deg), np.array(position.latitude_deg)


def _position(points: Points, index: int) -> Position:
    return Position(points[0].item(index), points[1].item(index))
