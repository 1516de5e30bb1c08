import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from skyway.geo import Position, distance_m, unit_vector
from skyway.network.great_circle import distances_m, unit_vectors

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
