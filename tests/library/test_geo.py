import math

import pytest

from skyway.geo import Position, bearing_rad, distance_m, point_between

SAN_MARCOS = Position(-97.94139, 29.88327)
SAN_ANTONIO = Position(-98.49363, 29.42412)


def test_the_paper_s_longest_distance_is_74_km_by_great_circle() -> None:
    assert distance_m(SAN_MARCOS, SAN_ANTONIO) == pytest.approx(73_900, abs=100)


def test_a_quarter_of_the_equator_is_a_quarter_of_the_circumference() -> None:
    quarter = distance_m(Position(0, 0), Position(90, 0))

    assert quarter == pytest.approx(math.pi / 2 * 6_371_008.8)


@pytest.mark.parametrize(
    ("end", "bearing"),
    [((0, 1), 0), ((1, 0), math.pi / 2), ((0, -1), math.pi), ((-1, 0), 3 * math.pi / 2)],
)
def test_bearings_turn_clockwise_from_north(end: tuple[float, float], bearing: float) -> None:
    assert bearing_rad(Position(0, 0), Position(*end)) == pytest.approx(bearing)


@pytest.mark.parametrize("fraction", [0.0, 0.25, 0.5, 1.0])
def test_a_point_between_divides_the_distance(fraction: float) -> None:
    point = point_between(SAN_MARCOS, SAN_ANTONIO, fraction=fraction)

    whole = distance_m(SAN_MARCOS, SAN_ANTONIO)
    assert distance_m(SAN_MARCOS, point) == pytest.approx(fraction * whole, abs=0.01)


def test_a_point_between_equal_places_is_that_place() -> None:
    assert point_between(SAN_MARCOS, SAN_MARCOS, fraction=0.5) == SAN_MARCOS
