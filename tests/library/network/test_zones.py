import math
from collections.abc import Sequence
from fractions import Fraction

import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from skyway.geo import Position
from skyway.ids import ZoneId
from skyway.network.network import Zone
from skyway.network.zones import Outline, points_of
from skyway.planner.obstacles import meets_zone


def crosses(zone: Zone, start: Position, end: Position) -> bool:
    """What the search and the verifier say about a line; they have geometries of their own."""
    (is_met,) = Outline(zone).meets(points_of([start]), points_of([end])).tolist()

    assert meets_zone(zone, start, end) is is_met
    return bool(is_met)


def contains(zone: Zone, position: Position) -> bool:
    return crosses(zone, position, position)


def make_zone(*rings: Sequence[tuple[float, float]]) -> Zone:
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
    Position, *[st.floats(-1, 7).map(lambda degrees: round(degrees, 9))] * 2
)
RINGS = st.lists(PLACES, min_size=3, max_size=6).map(lambda ring: (*ring, ring[0]))
ZONES = st.lists(RINGS, min_size=1, max_size=2).map(lambda rings: Zone(ZoneId("z"), tuple(rings)))


@given(zone=ZONES, lines=st.lists(st.tuples(PLACES, PLACES), max_size=8))
def test_the_verifier_and_the_search_agree_on_lines_and_zones(
    zone: Zone, lines: list[tuple[Position, Position]]
) -> None:
    met = Outline(zone).meets(*(points_of([line[end] for line in lines]) for end in (0, 1)))

    assert met.tolist() == [meets_zone(zone, *line) for line in lines]


# Degrees in eighths: a turned place is exact, so lines that only touch still touch.
EIGHTHS = st.integers(0, 48).map(lambda eighths: eighths / 8)
EXACT_PLACES = st.builds(Position, EIGHTHS, EIGHTHS)
EXACT_RINGS = st.lists(EXACT_PLACES, min_size=3, max_size=6)
TURNS = st.integers(-360, 360) | st.integers(174, 180)


def turned(place: Position, by_deg: float) -> Position:
    return Position(math.remainder(place.longitude_deg + by_deg, 360.0), place.latitude_deg)


@given(
    rings=st.lists(EXACT_RINGS, min_size=1, max_size=2),
    lines=st.lists(st.tuples(EXACT_PLACES, EXACT_PLACES), min_size=1, max_size=8),
    turn=TURNS,
)
def test_a_turned_zone_meets_the_same_lines(
    rings: list[list[Position]], lines: list[tuple[Position, Position]], turn: int
) -> None:
    zone = make_zone(*rings)
    elsewhere = make_zone(*[[turned(corner, turn) for corner in ring] for ring in rings])

    for start, end in lines:
        assert crosses(elsewhere, turned(start, turn), turned(end, turn)) is crosses(
            zone, start, end
        )


# Corners all around the Earth: rings that hold a pole, and edges that go the shorter way. Floats
# hold these steps exactly, also turned by 360 degrees.
AROUND = st.builds(
    Position,
    st.integers(-180 * 1024, 180 * 1024).map(lambda steps: steps / 1024),
    st.integers(-90 * 1024, 90 * 1024).map(lambda steps: steps / 1024),
)


@given(
    rings=st.lists(st.lists(AROUND, min_size=3, max_size=8), min_size=1, max_size=2),
    lines=st.lists(st.tuples(AROUND, AROUND), max_size=8),
)
@example(
    rings=[[Position(*corner) for corner in ((-0.4, 0.2), (0, -1), (-180, 0), (0.1, 0), (0, 0))]],
    lines=[(Position(-0.4, 0.0), Position(-0.4, 0.0))],
)
def test_the_verifier_and_the_search_agree_all_around_the_earth(
    rings: list[list[Position]], lines: list[tuple[Position, Position]]
) -> None:
    for start, end in lines:
        crosses(make_zone(*rings), start, end)


@pytest.mark.parametrize(
    ("ring", "inside", "outside"),
    [
        pytest.param(
            [(0, 80), (90, 80), (180, 80), (-90, 80)], (45.0, 85.0), (45.0, 75.0), id="pole"
        ),
        pytest.param(
            [(0, -80), (90, -80), (180, -80), (-90, -80)], (45.0, -85.0), (45.0, 0.0), id="south"
        ),
        pytest.param(
            [(-180, -90), (180, -90), (180, -60), (-180, -60)],
            (7.0, -70.0),
            (7.0, -50.0),
            id="a band of all longitudes",
        ),
        pytest.param(
            [(-180, 60), (0, 60), (180, 60), (180, 90), (0, 90), (-180, 90)],
            (-120.0, 89.0),
            (-120.0, 59.0),
            id="a cap with corners at the pole",
        ),
        pytest.param(
            [(170, 0), (-170, 0), (-170, 5), (170, 5)], (-175.0, 2.0), (0.0, 2.0), id="shorter way"
        ),
        pytest.param(
            [(-100, 0), (0, 0), (100, 0), (100, 5), (0, 5), (-100, 5)],
            (0.0, 2.0),
            (150.0, 2.0),
            id="the longer way by corners in between",
        ),
    ],
)
def test_a_ring_holds_what_lies_on_the_shorter_way_or_at_the_nearer_pole(
    ring: list[tuple[float, float]],
    inside: tuple[float, float],
    outside: tuple[float, float],
) -> None:
    assert contains(make_zone(ring), Position(*inside))
    assert not contains(make_zone(ring), Position(*outside))
