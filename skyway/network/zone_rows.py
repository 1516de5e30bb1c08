"""Which of many positions lie in a zone, and which of many lines meet it: `zones` by the array.

The same sums in the same order, so the same answers: where rounding leaves a doubt, `zones` is
asked. Who calls these has left out what lies outside the box of the zone.
"""

from itertools import chain, pairwise

import numpy as np
import numpy.typing as npt

from skyway.geo import Position
from skyway.network.columns import Floats
from skyway.network.parts import Zone
from skyway.network.zones import ROUNDING_SHARE, contains, crosses

#: Positions as longitudes and latitudes, ``(k,)`` each; a corner of a zone has single numbers.
Points = tuple[Floats, Floats]
Mask = npt.NDArray[np.bool_]


def which_lie_in(zone: Zone, points: Points) -> Mask:
    """Whether each position lies in the zone, ``(k,)``; its edge belongs to it."""
    inside, doubtful = _inside(zone, points)
    for index in np.flatnonzero(doubtful).tolist():
        inside[index] = contains(zone, _position(points, index))
    return inside


def which_cross(zone: Zone, starts: Points, ends: Points) -> Mask:
    """Whether each straight line meets the zone, ``(k,)``; touching its edge counts."""
    # No edge met: the whole line lies on one side of every ring, as its start does.
    meets, doubtful = _inside(zone, starts)
    for start, end in chain.from_iterable(map(_edges, zone.rings)):
        turn_start, start_doubtful = _turn(starts, ends, start)
        turn_end, end_doubtful = _turn(starts, ends, end)
        from_edge, from_doubtful = _turn(start, end, starts)
        to_edge, to_doubtful = _turn(start, end, ends)
        meets |= (turn_start != turn_end) & (from_edge != to_edge)
        doubtful |= start_doubtful | end_doubtful | from_doubtful | to_doubtful
    for index in np.flatnonzero(doubtful).tolist():
        meets[index] = crosses(zone, _position(starts, index), _position(ends, index))
    return meets


def _inside(zone: Zone, points: Points) -> tuple[Mask, Mask]:
    """Whether a ray north meets the rings oddly often: in the outer one and in no hole."""
    longitude_deg = points[0]
    doubtful = np.zeros(len(longitude_deg), np.bool_)
    in_rings = []
    for ring in zone.rings:
        is_inside = np.zeros(len(longitude_deg), np.bool_)
        for start, end in _edges(ring):
            is_left, is_doubtful = _turn(start, end, points)
            doubtful |= is_doubtful
            is_west, is_end_west = start[0] <= longitude_deg, end[0] <= longitude_deg
            is_inside ^= (is_west != is_end_west) & (~is_left == is_west)
        in_rings.append(is_inside)
    outer, *holes = in_rings
    for hole in holes:
        outer = outer & ~hole
    return outer, doubtful


def _turn(a: Points, b: Points, c: Points) -> tuple[Mask, Mask]:
    """Whether c lies left of the line a to b, and whether rounding leaves that in doubt."""
    left = (b[0] - a[0]) * (c[1] - a[1])
    right = (b[1] - a[1]) * (c[0] - a[0])
    turn = left - right
    return turn > 0, ~(np.abs(turn) > ROUNDING_SHARE * (np.abs(left) + np.abs(right)))


def _edges(ring: tuple[Position, ...]) -> list[tuple[Points, Points]]:
    """The ring's edges; one without extent tells nothing, unless there is no other."""
    edges = [(start, end) for start, end in pairwise(ring) if start != end] or [(ring[0], ring[1])]
    return [(_corner(start), _corner(end)) for start, end in edges]


def _corner(position: Position) -> Points:
    return np.array(position.longitude_deg), np.array(position.latitude_deg)


def _position(points: Points, index: int) -> Position:
    return Position(points[0].item(index), points[1].item(index))
