"""The networks that are planned on: synthetic cities of degree about 6, 4 pads a station."""

import functools
import math

import numpy as np
import numpy.typing as npt

from skyway.geo import EARTH_RADIUS_M
from skyway.network.network import Network
from skyway.network.synthetic import synthetic_city

SEED = 1


@functools.lru_cache(maxsize=1)
def city(stations: int) -> Network:
    """The city of this size; only the last one is kept, a million stations take memory."""
    return synthetic_city(stations=stations, seed=SEED)


def distances_m(network: Network, row: int) -> npt.NDArray[np.float64]:
    """Metres from this station to each, ``(n,)``: on a plane, which a city nearly is."""
    columns = network.columns
    stretch = math.cos(math.radians(columns.latitude_deg[row]))
    east_rad = np.radians(columns.longitude_deg - columns.longitude_deg[row]) * stretch
    north_rad = np.radians(columns.latitude_deg - columns.latitude_deg[row])
    apart_m: npt.NDArray[np.float64] = EARTH_RADIUS_M * np.hypot(east_rad, north_rad)
    return apart_m
