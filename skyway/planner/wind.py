"""Weather from wind: how a wind field changes the flights of one drone model.

A drone holds its course: it turns its nose into the wind so far that the wind does not drive it off
the segment. With airspeed v, wind along the segment a and across it c it moves over ground with
sqrt(v^2 - c^2) + a (the wind triangle).
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from skyway.drone.model import DroneModel
from skyway.network.network import Network
from skyway.planner.kernels.memory import Floats
from skyway.planner.weather import Weather
from skyway.planner.weather_document import LARGEST_FACTOR, LEAST_FACTOR

#: Factors are rounded up to whole multiples of this, so that periods with about the same wind count
#: as one. Our own choice.
_STEP: Final = 0.01

#: Metres; places nearer than this to the middle of a segment count as if they were so far.
_NEAREST_M: Final = 100.0

_M_PER_DEG: Final = 111_195.0


@dataclass(frozen=True, slots=True, eq=False)
class WindField:
    """The wind at some places, in periods that follow one another.

    Parameters
    ----------
    longitude_deg, latitude_deg
        ``(k,)``, the places.
    edges_s
        ``(p + 1,)``, where the periods begin, and last where they end; seconds since the start.
    east_mps, north_mps, gust_mps
        ``(p, k)``: where to and how fast the air moves, and how fast at most.
    energy_factor
        ``(p, k)``: what the energy of flights rises by beside the wind, for example in cold.
    error_mps
        ``(p,)``: by how much the wind may be wrong; it is counted as wind against the drone.
    """

    longitude_deg: Floats
    latitude_deg: Floats
    edges_s: Floats
    east_mps: Floats
    north_mps: Floats
    gust_mps: Floats
    energy_factor: Floats
    error_mps: Floats


def weather_of_wind(
    network: Network, model: DroneModel, wind: WindField, *, limit_mps: float
) -> Weather:
    """The weather of all segments for this model, which flies in gusts up to this limit.

    The speed of a drone depends on its load. The factor is that of the load with which the wind
    costs most. Segments on which a flight would take more than ten times as long are closed.
    """
    columns = network.columns
    stretch = math.cos(math.radians(float(columns.latitude_deg.mean())))
    x_m = _M_PER_DEG * stretch * columns.longitude_deg
    y_m = _M_PER_DEG * columns.latitude_deg
    from_row, to_row = columns.from_row, columns.to_row
    east, north = x_m[to_row] - x_m[from_row], y_m[to_row] - y_m[from_row]
    length_m = np.maximum(np.hypot(east, north), 1e-9)
    east, north = east / length_m, north / length_m
    shares = _shares(
        (x_m[from_row] + x_m[to_row]) / 2,
        (y_m[from_row] + y_m[to_row]) / 2,
        places=(_M_PER_DEG * stretch * wind.longitude_deg, _M_PER_DEG * wind.latitude_deg),
    )
    # By period and segment.
    to_east, to_north = wind.east_mps @ shares, wind.north_mps @ shares
    along_mps = to_east * east + to_north * north - wind.error_mps[:, None]
    across_mps = np.abs(to_east * north - to_north * east)
    time_factor = np.maximum(
        _time_factor(model.speed_empty_mps, along_mps, across_mps),
        _time_factor(model.speed_full_mps, along_mps, across_mps),
    )
    is_too_strong = (wind.gust_mps @ shares > limit_mps) | (time_factor > LARGEST_FACTOR)
    return Weather(
        network,
        np.arange(len(length_m)),
        np.ascontiguousarray(wind.edges_s, np.float64),
        np.where(is_too_strong, math.inf, _rounded(time_factor)),
        np.minimum(_rounded(wind.energy_factor @ shares), LARGEST_FACTOR),
    )


def _time_factor(speed_mps: float, along_mps: Floats, across_mps: Floats) -> Floats:
    """How many times longer a flight takes; inf where the drone cannot hold its course."""
    ahead_mps = np.sqrt(np.maximum(speed_mps**2 - across_mps**2, 0.0))
    ground_mps = np.where(across_mps < speed_mps, ahead_mps + along_mps, 0.0)
    factor: Floats = np.full_like(ground_mps, math.inf)
    np.divide(speed_mps, ground_mps, out=factor, where=ground_mps > 0.0)
    return factor


def _rounded(factor: Floats) -> Floats:
    """The factors rounded up to the step, at least the least factor of a problem."""
    # A little less first, so that sums of floats do not lift a whole step by one.
    steps = np.ceil(factor / _STEP - 1e-6)
    rounded: Floats = np.maximum(steps * _STEP, LEAST_FACTOR)
    return rounded


def _shares(x_m: Floats, y_m: Floats, *, places: tuple[Floats, Floats]) -> Floats:
    """``(k, n)``: the share of each place in the wind at each point, by its squared distance."""
    apart_m = np.hypot(places[0][:, None] - x_m, places[1][:, None] - y_m)
    weight = 1.0 / np.maximum(apart_m, _NEAREST_M) ** 2
    shares: Floats = weight / weight.sum(axis=0)
    return shares
