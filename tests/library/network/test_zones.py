import math
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from skyway.geo import Position
from skyway.ids import ZoneId
from skyway.network.network import Zone
from skyway.network.zones import contains, crosses


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


def test_a_line_in_the_mouth_of_a_horseshoe_does_not_cross_it() -> None:
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


def test_a_miss_that_rounding_would_take_for_a_touch_is_a_miss() -> None:
    triangle = make_zone([(-24.0, -24.0), (24.0, 24.0), (24.0, -24.0)])
    just_above_half = math.nextafter(0.5, 1.0)

    assert contains(triangle, Position(0.5, 0.5))
    assert not contains(triangle, Position(0.5, just_above_half))
    assert not crosses(triangle, Position(0.5, just_above_half), Position(0.5, 20.0))


COORDINATES = st.integers(0, 6).map(float)
CORNERS = st.tuples(COORDINATES, COORDINATES)


def in_triangle(corners: list[tuple[float, float]], point: tuple[Fraction, Fraction]) -> bool:
    """The closed triangle, by the signs of exact turns."""
    turns = [
        (Fraction(b[0]) - Fraction(a[0])) * (point[1] - Fraction(a[1]))
        - (Fraction(b[1]) - Fraction(a[1])) * (point[0] - Fraction(a[0]))
        for a, b in zip(corners, corners[1:] + corners[:1], strict=True)
    ]
    return all(turn >= 0 for turn in turns) or all(turn <= 0 for turn in turns)


def is_flat(corners: list[tuple[float, float]]) -> bool:
    (ax, ay), (bx, by), (cx, cy) = corners
    return (bx - ax) * (cy - ay) == (by - ay) * (cx - ax)


@given(corners=st.lists(CORNERS, min_size=3, max_size=3), start=CORNERS, end=CORNERS)
def test_triangles_agree_with_an_exact_walk_along_the_line(
    corners: list[tuple[float, float]], start: tuple[float, float], end: tuple[float, float]
) -> None:
    if is_flat(corners):
        return
    triangle = make_zone(corners)
    walk = [
        tuple(
            Fraction(a) + (Fraction(b) - Fraction(a)) * step / 60
            for a, b in zip(start, end, strict=True)
        )
        for step in range(61)
    ]
    met = [in_triangle(corners, (point[0], point[1])) for point in walk]

    assert contains(triangle, Position(*start)) == met[0]
    if any(met):
        assert crosses(triangle, Position(*start), Position(*end))
