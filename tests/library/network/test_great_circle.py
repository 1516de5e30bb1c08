import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from skyway.geo import Position, bearing_rad, distance_m, point_between, unit_vector
from skyway.network.great_circle import beside_deg, courses, distances_m, unit_vectors, unrolled_deg

POSITIONS = st.builds(Position, st.floats(-180, 180), st.floats(-90, 90))


@given(start=POSITIONS, end=POSITIONS)
def test_distances_of_arrays_equal_single_distances_to_the_last_bit(
    start: Position, end: Position
) -> None:
    longitudes, latitudes = np.array((start, end)).T

    found = distances_m((longitudes[:1], longitudes[1:]), (latitudes[:1], latitudes[1:]))

    assert found.tolist() == [distance_m(start, end)]


@given(position=POSITIONS)
def test_directions_of_arrays_equal_single_directions(position: Position) -> None:
    (vector,) = unit_vectors(*map(np.atleast_1d, position)).tolist()

    assert tuple(vector) == unit_vector(position)


@given(start=POSITIONS, end=POSITIONS)
def test_courses_are_those_of_single_flights_at_their_middles(
    start: Position, end: Position
) -> None:
    assume(1e3 < distance_m(start, end) < 1.9e7)
    middle = point_between(start, end, fraction=0.5)
    assume(abs(middle.latitude_deg) < 89.9)
    longitudes, latitudes = np.array((start, end)).T

    found = courses((longitudes[:1], longitudes[1:]), (latitudes[:1], latitudes[1:]))

    at = Position(found.longitude_deg.item(), found.latitude_deg.item())
    bearing = math.atan2(found.east.item(), found.north.item())
    assert distance_m(at, middle) < 0.01
    assert math.remainder(bearing - bearing_rad(middle, end), math.tau) == pytest.approx(
        0.0, abs=1e-4
    )


def test_longitudes_of_one_area_lie_side_by_side() -> None:
    assert unrolled_deg(np.array([179.5, -179.5, 180.0])).tolist() == [179.5, 180.5, 180.0]
    assert unrolled_deg(np.array([-10.0, 10.0, 0.1])).tolist() == [-10.0, 10.0, 0.1]
    assert unrolled_deg(np.empty(0)).tolist() == []


@given(longitude=st.floats(-180, 180), reference=st.floats(-180, 180))
def test_a_longitude_beside_another_is_the_same_meridian(
    longitude: float, reference: float
) -> None:
    (beside,) = beside_deg(np.array([longitude]), reference).tolist()

    assert abs(beside - reference) <= 180.0
    assert (beside - longitude) % 360.0 == pytest.approx(0.0)
    assert beside == longitude or abs(longitude - reference) >= 180.0
