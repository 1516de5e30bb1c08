"""`skyway.geo` by the array; distances equal `skyway.geo.distance_m` to the last bit.

NumPy's own sine differs in the last bit from machine to machine. The content of a network, and so
its version, must not.
"""

import math
from collections.abc import Callable
from itertools import repeat
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from skyway.geo import EARTH_RADIUS_M, arc_of
from skyway.network.columns import Floats

_RAD_PER_DEG = math.pi / 180.0


def distances_m(
    longitude_deg: tuple[Floats, Floats], latitude_deg: tuple[Floats, Floats]
) -> Floats:
    """Distance from each start to its end; all arrays ``(k,)`` float64, as (starts, ends)."""
    latitude_1, latitude_2 = (degrees * _RAD_PER_DEG for degrees in latitude_deg)
    half_latitude = (latitude_2 - latitude_1) / 2
    half_longitude = (longitude_deg[1] - longitude_deg[0]) * _RAD_PER_DEG / 2
    chord = _square(_each(math.sin, half_latitude)) + _each(math.cos, latitude_1) * _each(
        math.cos, latitude_2
    ) * _square(_each(math.sin, half_longitude))
    return 2 * EARTH_RADIUS_M * _each(math.asin, np.minimum(1.0, np.sqrt(chord)))


def beside_deg(longitude_deg: Floats, reference_deg: Floats | float) -> Floats:
    """The longitudes by as many whole turns that they lie at most 180 degrees from the reference.

    A longitude that lies there already keeps every bit.
    """
    turns = np.rint((longitude_deg - reference_deg) / 360.0)
    beside: Floats = longitude_deg - 360.0 * turns
    return beside


def unrolled_deg(longitude_deg: Floats) -> Floats:
    """The longitudes of one area side by side, also where it crosses longitude 180."""
    if not len(longitude_deg):
        return longitude_deg
    west, east = arc_of(longitude_deg.tolist())
    return beside_deg(longitude_deg, (west + east + (360.0 if west > east else 0.0)) / 2)


def unit_vectors(longitude_deg: Floats, latitude_deg: Floats) -> npt.NDArray[np.float64]:
    """The directions from the Earth's centre, ``(n, 3)``, as in `skyway.geo.unit_vector`."""
    longitude, latitude = longitude_deg * _RAD_PER_DEG, latitude_deg * _RAD_PER_DEG
    across = _each(math.cos, latitude)
    return np.column_stack(
        (
            across * _each(math.cos, longitude),
            across * _each(math.sin, longitude),
            _each(math.sin, latitude),
        )
    )


class Courses(NamedTuple):
    """The middles of flights, and where to they go there: parts of a step of length 1.

    ``(k,)`` float64 each. All are 0 to the east and north for a flight without length.
    """

    longitude_deg: Floats
    latitude_deg: Floats
    east: Floats
    north: Floats


def courses(longitude_deg: tuple[Floats, Floats], latitude_deg: tuple[Floats, Floats]) -> Courses:
    """The great circles from each start to its end, at their middles; all arrays ``(k,)``."""
    start, end = map(unit_vectors, longitude_deg, latitude_deg)
    (x, y, z), (ahead_x, ahead_y, ahead_z) = (start + end).T, (end - start).T
    beside = np.maximum(np.hypot(x, y), 1e-300)
    latitude = np.arctan2(z, beside)
    east = (x * ahead_y - y * ahead_x) / beside
    outward = (x * ahead_x + y * ahead_y) / beside
    north = np.cos(latitude) * ahead_z - np.sin(latitude) * outward
    length = np.maximum(np.hypot(east, north), 1e-15)
    longitude = np.arctan2(y, x)
    return Courses(np.degrees(longitude), np.degrees(latitude), east / length, north / length)


def _each(function: Callable[[float], float], values: Floats) -> Floats:
    return np.fromiter(map(function, values.tolist()), np.float64, len(values))


def _square(values: Floats) -> Floats:
    # Squares as ** computes them for floats; values * values may round differently.
    return np.fromiter(map(math.pow, values.tolist(), repeat(2.0)), np.float64, len(values))
