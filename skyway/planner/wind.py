"""Weather from wind: how a wind field changes the flights of one drone model.

A drone holds its course: it turns its nose into the wind so far that the wind does not drive it off
the segment. With airspeed v, wind along the segment a and across it c it moves over ground with
sqrt(v^2 - c^2) + a (the wind triangle).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from skyway.drone.model import DroneModel
from skyway.geo import EARTH_RADIUS_M
from skyway.network.great_circle import beside_deg, courses, unit_vectors
from skyway.network.network import Network
from skyway.planner.kernels.memory import Floats, Longs
from skyway.planner.weather import Weather
from skyway.planner.weather_document import LARGEST_FACTOR, LEAST_FACTOR

#: Factors are rounded up to whole multiples of this, so that periods with about the same wind count
#: as one. Our own choice.
_STEP: Final = 0.01

#: Metres; places nearer than this to the middle of a segment count as if they were so far.
_NEAREST_M: Final = 100.0

#: How many nearest places count for one point, and how many distances are computed together.
_MOST_PLACES: Final = 8
_TOGETHER: Final = 1_000_000

#: The values of each segment.
_VALUES: Final = ("along_mps", "across_mps", "gust_mps", "energy_factor", "error_mps")


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
        ``(p, k)``: by how much the wind may be wrong. It counts as wind against the drone, or as a
        standard deviation in each direction.
    grid
        How many latitudes and longitudes, if the places are a grid: one latitude after the other,
        both rising, the longitudes beyond 180 degrees where they cross it. Else None.
    """

    longitude_deg: Floats
    latitude_deg: Floats
    edges_s: Floats
    east_mps: Floats
    north_mps: Floats
    gust_mps: Floats
    energy_factor: Floats
    error_mps: Floats
    grid: tuple[int, int] | None = None


class PlaceWeights(NamedTuple):
    """The places that count for each point, and the weight of each: ``(j, n)`` both.

    The weights of a point add up to 1.
    """

    place: Longs
    weight: Floats

    def of(self, values: Floats) -> Floats:
        """``(p, n)``: the values at the points, from those at the places, ``(p, k)``."""
        rows = zip(self.place, self.weight, strict=True)
        at_points: Floats = sum(
            (values[:, place] * weight for place, weight in rows),
            start=np.zeros((len(values), self.place.shape[1])),
        )
        return at_points


@dataclass(frozen=True, slots=True, eq=False)
class SegmentWind:
    """The wind on all segments of a network, the same for all drone models: ``(p, n)`` each.

    `along_mps` is the wind with the drone, `across_mps` that from the side.
    """

    network: Network
    edges_s: Floats
    along_mps: Floats
    across_mps: Floats
    gust_mps: Floats
    energy_factor: Floats
    error_mps: Floats

    @classmethod
    def of(cls, network: Network, wind: WindField) -> "SegmentWind":
        """The wind at the middle of each segment."""
        columns = network.columns
        at_deg, ends = (
            (columns.longitude_deg, columns.latitude_deg),
            (columns.from_row, columns.to_row),
        )
        longitude_deg, latitude_deg, east, north = courses(
            *((degrees[ends[0]], degrees[ends[1]]) for degrees in at_deg)
        )
        weights = weights_of(wind, longitude_deg=longitude_deg, latitude_deg=latitude_deg)
        to_east, to_north = weights.of(wind.east_mps), weights.of(wind.north_mps)
        return cls(
            network,
            np.ascontiguousarray(wind.edges_s, np.float64),
            to_east * east + to_north * north,
            np.abs(to_east * north - to_north * east),
            weights.of(wind.gust_mps),
            np.minimum(rounded_factor(weights.of(wind.energy_factor)), LARGEST_FACTOR),
            weights.of(wind.error_mps),
        )

    def without_error(self) -> "SegmentWind":
        """The same wind without its error."""
        return replace(self, error_mps=np.zeros_like(self.error_mps))

    def at(self, segment: int, at_s: float) -> "SegmentWind | None":
        """The wind on one segment, by its row, at one moment; None outside of all periods."""
        period = int(np.searchsorted(self.edges_s, at_s, side="right")) - 1
        if not 0 <= period < len(self.edges_s) - 1:
            return None
        one = np.s_[period : period + 1, segment : segment + 1]
        return replace(self, **{name: getattr(self, name)[one] for name in _VALUES})

    def of_flights(self, segments: Longs, at_s: Floats, *, least_error_mps: float) -> "SegmentWind":
        """``(1, n)``: the wind of flights on these segments that begin at these moments.

        Outside of all periods the nearest one counts. No stated error counts as the least error.
        """
        period = np.searchsorted(self.edges_s, at_s, side="right") - 1
        period = period.clip(0, len(self.edges_s) - 2)
        found = {name: getattr(self, name)[period, segments][None, :] for name in _VALUES}
        error_mps = np.where(found["error_mps"] > 0.0, found["error_mps"], least_error_mps)
        return replace(self, **(found | {"error_mps": error_mps}))

    def in_error(self, model: DroneModel, deviations: float) -> Floats:
        """``(p, n)``: by how much more energy flights need if the wind is wrong, as a logarithm.

        The wind is wrong by so many of its standard errors, in the direction that slows the drone
        most; inf where the drone could not fly then. Plans count no energy that a tail wind saves,
        so an error that only takes a tail wind away costs nothing.
        """
        planned = np.maximum(_most(_time_factor, model, self.along_mps, self.across_mps), 1.0)
        is_open = np.isfinite(planned)
        planned = np.where(is_open, planned, 1.0)
        wrong_mps = deviations * self.error_mps
        worse = _most(_slowed, model, self.along_mps, self.across_mps, wrong_mps)
        return np.where(is_open, np.log(np.maximum(worse, planned) / planned), 0.0)

    def weather(self, model: DroneModel, *, limit_mps: float) -> Weather:
        """The weather for drones of this model; see `weather_of_wind`."""
        against_mps = self.along_mps - self.error_mps
        time_factor = _most(_time_factor, model, against_mps, self.across_mps)
        # A weighted mean may exceed a limit by rounding alone.
        is_too_strong = self.gust_mps > limit_mps + 1e-9
        is_too_strong |= time_factor > LARGEST_FACTOR
        return Weather(
            self.network,
            np.arange(self.along_mps.shape[1]),
            self.edges_s,
            np.where(is_too_strong, math.inf, rounded_factor(time_factor)),
            self.energy_factor,
        )


def weather_of_wind(
    network: Network, model: DroneModel, wind: WindField, *, limit_mps: float
) -> Weather:
    """The weather of all segments for this model, which flies in gusts up to this limit.

    The speed of a drone depends on its load. The factor is that of the load with which the wind
    costs most. Segments on which a flight would take more than ten times as long are closed.
    """
    return SegmentWind.of(network, wind).weather(model, limit_mps=limit_mps)


def without_savings(weather: Weather) -> Weather:
    """The same weather, in which no wind saves energy; a tail wind only saves time.

    Plans that count on the energy of a tail wind would strand a drone when the wind drops.
    """
    at_least = rounded_factor(1.0 / weather.time_factor)
    return replace(weather, energy_factor=np.maximum(weather.energy_factor, at_least))


def _most(factor: Callable[..., Floats], model: DroneModel, *wind_mps: Floats) -> Floats:
    """The factor in this wind for the load with which it is larger: empty or full."""
    factors = factor(model.speed_empty_mps, *wind_mps)
    if model.speed_full_mps != model.speed_empty_mps:
        factors = np.maximum(factors, factor(model.speed_full_mps, *wind_mps))
    return factors


def _slowed(speed_mps: float, along_mps: Floats, across_mps: Floats, wrong_mps: Floats) -> Floats:
    """The time factor if the wind is wrong by so much, in the direction that slows most.

    In a cross wind this is not straight against the drone: a stronger cross wind slows it too.
    """
    ahead_mps = np.sqrt(np.maximum(speed_mps**2 - across_mps**2, 0.0))
    return _time_factor(
        speed_mps,
        along_mps - wrong_mps * ahead_mps / speed_mps,
        across_mps + wrong_mps * np.minimum(across_mps / speed_mps, 1.0),
    )


def _time_factor(speed_mps: float, along_mps: Floats, across_mps: Floats) -> Floats:
    """How many times longer a flight takes; inf where the drone cannot hold its course."""
    ahead_mps = np.sqrt(np.maximum(speed_mps**2 - across_mps**2, 0.0))
    ground_mps = np.where(across_mps < speed_mps, ahead_mps + along_mps, 0.0)
    factor: Floats = np.full_like(ground_mps, math.inf)
    np.divide(speed_mps, ground_mps, out=factor, where=ground_mps > 0.0)
    return factor


def rounded_factor(factor: Floats) -> Floats:
    """The factors rounded up to the step, at least the least factor of a problem."""
    # A little less first, so that sums of floats do not lift a whole step by one.
    steps = np.ceil(factor / _STEP - 1e-6)
    rounded: Floats = np.maximum(steps * _STEP, LEAST_FACTOR)
    return rounded


def weights_of(wind: WindField, *, longitude_deg: Floats, latitude_deg: Floats) -> PlaceWeights:
    """The weights of the field's places in the weather of these points.

    On a grid the four places around a point count, by how near they are in both directions. Beyond
    the grid its border counts. Without a grid the nearest places count, by their squared distance.
    """
    if wind.grid is not None:
        return _on_grid(wind, wind.grid, longitude_deg, latitude_deg)
    nearest, far_m = nearest_places(wind, longitude_deg=longitude_deg, latitude_deg=latitude_deg)
    weight = 1.0 / np.maximum(far_m, _NEAREST_M) ** 2
    return PlaceWeights(nearest, weight / weight.sum(axis=0))


def nearest_places(
    wind: WindField, *, longitude_deg: Floats, latitude_deg: Floats
) -> tuple[Longs, Floats]:
    """``(j, n)`` both: the nearest places to each point, unordered, and their distances, metres."""
    count, points = len(wind.longitude_deg), len(longitude_deg)
    kept = min(count, _MOST_PLACES)
    nearest, far_m = np.empty((kept, points), np.int64), np.empty((kept, points))
    step = max(1, _TOGETHER // count)
    places_at, points_at = (
        unit_vectors(*at).T[:, :, None]
        for at in ((wind.longitude_deg, wind.latitude_deg), (longitude_deg, latitude_deg))
    )
    for start in range(0, points, step):
        these = slice(start, start + step)
        pairs = zip(places_at, points_at, strict=True)
        chord = np.sqrt(sum((place - point[these].T) ** 2 for place, point in pairs))
        apart_m = 2 * EARTH_RADIUS_M * np.arcsin(np.minimum(chord / 2, 1.0))
        nearest[:, these] = np.argpartition(apart_m, kept - 1, axis=0)[:kept]
        far_m[:, these] = np.take_along_axis(apart_m, nearest[:, these], axis=0)
    return nearest, far_m


def _on_grid(
    wind: WindField, grid: tuple[int, int], longitude_deg: Floats, latitude_deg: Floats
) -> PlaceWeights:
    columns, axis_deg = grid[1], longitude_axis(wind.longitude_deg[: grid[1]])
    south, to_north = _between(wind.latitude_deg[::columns], latitude_deg)
    west, to_east = _between(axis_deg, beside_deg(longitude_deg, (axis_deg[0] + axis_deg[-1]) / 2))
    north, east = np.minimum(south + 1, grid[0] - 1), np.minimum(west + 1, len(axis_deg) - 1)
    west, east = west % columns, east % columns
    corners = ((south, west), (south, east), (north, west), (north, east))
    weights = (
        (1 - to_north) * (1 - to_east),
        (1 - to_north) * to_east,
        to_north * (1 - to_east),
        to_north * to_east,
    )
    places = np.array([row * columns + column for row, column in corners])
    return PlaceWeights(places, np.array(weights))


def longitude_axis(longitude_deg: Floats) -> Floats:
    """The longitudes of a grid; all around the Earth the first one follows the last one again."""
    gap_deg = 360.0 - (longitude_deg[-1] - longitude_deg[0])
    if 0.0 < gap_deg <= np.diff(longitude_deg).max(initial=0.0) * (1 + 1e-9):
        return np.append(longitude_deg, longitude_deg[0] + 360.0)
    return longitude_deg


def _between(axis_deg: Floats, at_deg: Floats) -> tuple[Longs, Floats]:
    """The number of the last value of an axis up to each point, and the weight of the next one."""
    number = np.clip(np.searchsorted(axis_deg, at_deg, side="right") - 1, 0, len(axis_deg) - 1)
    if len(axis_deg) == 1:
        return number, np.zeros(len(at_deg))
    number = np.minimum(number, len(axis_deg) - 2)
    share = (at_deg - axis_deg[number]) / (axis_deg[number + 1] - axis_deg[number])
    return number, np.clip(share, 0.0, 1.0)
