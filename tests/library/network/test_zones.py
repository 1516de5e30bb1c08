import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from skyway.geo import Position
from skyway.ids import ZoneId
from skyway.network.network import Zone
from skyway.network.zones import Points, contains, crosses, which_cross, which_lie_in


def make_zone(*rings: list[tuple[float, float]]) -> Zone:
    closed = tuple(tuple(Position(*corner) for corner in (*ring, ring[0])) for ring in rings)
    return Zone(ZoneId("zone"), closed)


SQUARE = [(0.0, 0.0), (3.0, 0.0), (3.0, 3.0), (0.0, 3.0)]
HOLE = [(1.0, 1.0), (2.0, 1.0), (2.0, 2.0), (1.0, 2.0)]
RING = make_zone(SQUARE, HOLE)
HORSESHOE = make_zone([(0, 0), (3, 0), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)])


@pytest.mark.parametrize(
    ("start", "end", "why"),
    [
        ((-1.0, 0.5), (4.0, 0.5), "straight through"),
        ((-1.0, 0.5), (0.5, 0.5), "ends inside"),
        ((0.2, 0.2), (0.8, 0.8), "wholly inside"),
        ((-1.0, 1.0), (1.0, -1.0), "touches a corner"),
        ((-1.0, 0.0), (4.0, 0.0), "runs along an edge"),
        ((-1.0, 3.0), (0.0, 3.0), "ends at a corner"),
        ((3.0, 1.0), (5.0, 1.0), "starts on an edge"),
        ((1.5, 1.5), (4.0, 1.5), "leaves through the hole"),
        ((1.5, 1.5), (2.0, 1.5), "touches the hole's edge from within"),
        ((0.5, 0.5), (0.5, 0.5), "stands still inside"),
    ],
)
def test_a_line_that_meets_the_zone_crosses_it(
    start: tuple[float, float], end: tuple[float, float], why: str
) -> None:
    assert crosses(RING, Position(*start), Position(*end)), why
    assert crosses(RING, Position(*end), Position(*start)), why


@pytest.mark.parametrize(
    ("start", "end", "why"),
    [
        ((-1.0, -1.0), (4.0, -1.0), "passes south of it"),
        ((-1.0, 0.9), (0.9, -1.0), "passes its corner, inside its box"),
        ((1.2, 1.2), (1.8, 1.8), "wholly inside the hole"),
        ((3.1, 0.0), (3.1, 3.0), "runs beside an edge"),
        ((1.5, 1.5), (1.5, 1.5), "stands still in the hole"),
    ],
)
def test_a_line_that_misses_the_zone_does_not_cross_it(
    start: tuple[float, float], end: tuple[float, float], why: str
) -> None:
    assert not crosses(RING, Position(*start), Position(*end)), why
    assert not crosses(RING, Position(*end), Position(*start)), why


def test_a_line_between_the_arms_of_a_horseshoe_does_not_cross_it() -> None:
    assert not crosses(HORSESHOE, Position(1.5, 1.5), Position(1.5, 4.0))
    assert crosses(HORSESHOE, Position(1.5, 2.0), Position(2.5, 2.0))


@pytest.mark.parametrize(
    ("position", "is_inside"),
    [
        ((0.5, 0.5), True),
        ((0.0, 0.0), True),
        ((1.5, 0.0), True),
        ((1.0, 1.5), True),
        ((2.0, 2.0), True),
        ((1.5, 1.5), False),
        ((3.000001, 1.0), False),
        ((-5.0, 0.0), False),
    ],
)
def test_edges_belong_to_the_zone_and_holes_do_not(
    position: tuple[float, float], is_inside: bool
) -> None:
    assert contains(RING, Position(*position)) is is_inside


def test_a_corner_level_with_the_position_is_not_counted_twice() -> None:
    diamond = make_zone([(0, -1), (1, 0), (0, 1), (-1, 0)])

    assert contains(diamond, Position(0.0, 0.5))
    assert not contains(diamond, Position(0.9, 0.9))


def test_a_line_that_misses_by_less_than_rounding_does_not_cross() -> None:
    triangle = make_zone([(-24.0, -24.0), (24.0, 24.0), (24.0, -24.0)])
    just_above_half = math.nextafter(0.5, 1.0)

    assert contains(triangle, Position(0.5, 0.5))
    assert not contains(triangle, Position(0.5, just_above_half))
    assert not crosses(triangle, Position(0.5, just_above_half), Position(0.5, 20.0))


CORNERS = st.tuples(st.integers(0, 6), st.integers(0, 6))


def turn(a: tuple[int, int], b: tuple[int, int], c: tuple[int, int]) -> int:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def meets_triangle(
    corners: list[tuple[int, int]], start: tuple[int, int], end: tuple[int, int]
) -> bool:
    """Whether something of the line is left after clipping it at the triangle's three sides."""
    side = 1 if turn(*corners) > 0 else -1
    first, last = Fraction(0), Fraction(1)
    for a, b in zip(corners, corners[1:] + corners[:1], strict=True):
        depth, end_depth = side * turn(a, b, start), side * turn(a, b, end)
        if depth < 0 and end_depth < 0:
            return False
        if depth < 0 <= end_depth:
            first = max(first, Fraction(depth, depth - end_depth))
        if end_depth < 0 <= depth:
            last = min(last, Fraction(depth, depth - end_depth))
    return first <= last


@given(corners=st.lists(CORNERS, min_size=3, max_size=3), start=CORNERS, end=CORNERS)
def test_triangles_agree_with_exact_clipping(
    corners: list[tuple[int, int]], start: tuple[int, int], end: tuple[int, int]
) -> None:
    assume(turn(*corners) != 0)
    triangle = make_zone([(float(x), float(y)) for x, y in corners])

    assert contains(triangle, Position(*start)) == meets_triangle(corners, start, start)
    assert crosses(triangle, Position(*start), Position(*end)) == meets_triangle(
        corners, start, end
    )


# Places on a coarse grid, which touch and overlap, and places anywhere.
PLACES = st.builds(Position, *[st.integers(0, 6).map(float)] * 2) | st.builds(
    Position, *[st.floats(-1, 7)] * 2
)
RINGS = st.lists(PLACES, min_size=3, max_size=6).map(lambda ring: (*ring, ring[0]))
ZONES = st.lists(RINGS, min_size=1, max_size=2).map(lambda rings: Zone(ZoneId("z"), tuple(rings)))


def points_of(positions: list[Position]) -> Points:
    longitude_deg, latitude_deg = np.array(positions, np.float64).reshape(-1, 2).T
    return longitude_deg, latitude_deg


def is_near(zone: Zone, *ends: Position) -> bool:
    """Whether the box around these places meets the zone's box; callers leave out the others."""
    south_west, north_east = zone.box
    longitudes = [end.longitude_deg for end in ends]
    latitudes = [end.latitude_deg for end in ends]
    return (
        max(longitudes) >= south_west.longitude_deg
        and min(longitudes) <= north_east.longitude_deg
        and max(latitudes) >= south_west.latitude_deg
        and min(latitudes) <= north_east.latitude_deg
    )


@given(zone=ZONES, positions=st.lists(PLACES, max_size=8))
def test_arrays_of_positions_lie_in_a_zone_like_single_positions(
    zone: Zone, positions: list[Position]
) -> None:
    near = [position for position in positions if is_near(zone, position)]

    inside = which_lie_in(zone, points_of(near))

    assert inside.tolist() == [contains(zone, position) for position in near]


@given(zone=ZONES, lines=st.lists(st.tuples(PLACES, PLACES), max_size=8))
def test_arrays_of_lines_cross_a_zone_like_single_lines(
    zone: Zone, lines: list[tuple[Position, Position]]
) -> None:
    near = [line for line in lines if is_near(zone, *line)]

    met = which_cross(zone, points_of([a for a, _ in near]), points_of([b for _, b in near]))

    assert met.tolist() == [crosses(zone, *line) for line in near]
