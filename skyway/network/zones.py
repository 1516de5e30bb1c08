"""Which lines meet a zone, and which positions lie in it.

All of this happens in the plane of longitude and latitude: lines are straight there, and a zone is
its closed outer ring without its open holes. A zone across the antimeridian has to be cut into two.
"""

from collections.abc import Iterator
from fractions import Fraction
from itertools import pairwise

from skyway.geo import Position
from skyway.network.network import Zone

#: A turn smaller than this share of its terms is recomputed exactly: the rounding error of the
#: three roundings on each side (Shewchuk 1997, "Adaptive precision floating-point arithmetic").
ROUNDING_SHARE = 4 * 2.0**-52


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
    # No edge is met, so the whole line lies on one side of every ring, as its start does.
    return contains(zone, start)


def contains(zone: Zone, position: Position) -> bool:
    """Whether the position lies in the zone; its edge, also around a hole, belongs to it."""
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


def _edges(zone: Zone) -> Iterator[tuple[Position, Position]]:
    for ring in zone.rings:
        yield from pairwise(ring)


def _is_inside(ring: tuple[Position, ...], position: Position) -> bool:
    """Whether a position that is not on the ring lies inside: a ray north meets it oddly often."""
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
    if abs(turn) > ROUNDING_SHARE * (abs(left) + abs(right)):
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
