"""A forecast of wind and temperature, and the weather of a network that follows from it.

The values of a period hold as they are until it ends. After the last period they still count, but
less and less: the deviation from still air is halved every three hours, and after twelve hours the
air is still. Our own choice: wind changes within hours, and a plan must not rely on an old wind.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from skyway.drone.model import DroneModel
from skyway.geo import EARTH_RADIUS_M
from skyway.network.great_circle import beside_deg
from skyway.network.network import Network
from skyway.planner.energy_risk import CLIMATE_MPS, FORECAST_ERROR_MPS, EnergyRisk
from skyway.planner.kernels.memory import Floats
from skyway.planner.weather import Weather
from skyway.planner.weather_document import LARGEST_FACTOR
from skyway.planner.wind import (
    SegmentWind,
    WindField,
    longitude_axis,
    nearest_places,
    rounded_factor,
    without_savings,
)

#: The periods after the last one: the length of each, seconds, and the share of the deviation from
#: still air that is left in each.
FADING_S: Final = 10_800.0
FADING: Final = (0.5, 0.25, 0.125, 0.0625)

#: Below this temperature each degree raises the energy of flights by this share: a cold battery
#: gives less of its charge. Our own choice.
_COOL_C: Final = 10.0
_MORE_PER_DEGREE: Final = 0.01

#: The farthest that a station may be outside of a grid, or from the nearest place, metres.
FARTHEST_M: Final = 50_000.0

#: A temperature at which flights need no more energy and charging takes no longer, degrees Celsius:
#: it counts where no temperature is given.
MILD_C: Final = 15.0

#: How long before its first time a forecast can be in force, at most, seconds: 400 days.
_LONG_BEFORE_S: Final = 400 * 86_400.0

_VALUES: Final = ("east_mps", "north_mps", "gust_mps", "temperature_c", "error_mps")


# Without slots, because whether the air is still is computed on first use and cached.
@dataclass(frozen=True, eq=False)
class Forecast:
    """Wind and temperature at k places in p periods that follow one another.

    Parameters
    ----------
    longitude_deg, latitude_deg
        ``(k,)``, the places; with a `grid` as in `WindField`.
    edges_s
        ``(p + 1,)``, where the periods begin, and last where they end; seconds by any clock.
    east_mps, north_mps
        ``(p, k)``, where to and how fast the air moves.
    gust_mps, temperature_c, error_mps
        ``(p, k)``: how fast the air moves at most, its temperature, and the standard error of the
        wind.
    """

    longitude_deg: Floats
    latitude_deg: Floats
    edges_s: Floats
    east_mps: Floats
    north_mps: Floats
    gust_mps: Floats
    temperature_c: Floats
    error_mps: Floats
    grid: tuple[int, int] | None = None

    def first(self, periods: int) -> "Forecast":
        """The forecast with at most its first periods."""
        if periods >= len(self.edges_s) - 1:
            return self
        return replace(
            self,
            edges_s=self.edges_s[: periods + 1],
            **{name: getattr(self, name)[:periods] for name in _VALUES},
        )

    def field(self) -> WindField:
        """The wind in all periods, also those after the last one, in which it fades."""
        cold = _MORE_PER_DEGREE * np.maximum(0.0, _COOL_C - self.temperature_c)
        fading_s = self.edges_s[-1] + FADING_S * np.arange(1, len(FADING) + 1)
        strongest = np.hypot(self.east_mps, self.north_mps)
        return WindField(
            longitude_deg=self.longitude_deg,
            latitude_deg=self.latitude_deg,
            edges_s=np.concatenate((self.edges_s, fading_s)),
            east_mps=_faded(self.east_mps),
            north_mps=_faded(self.north_mps),
            gust_mps=_faded(np.maximum(self.gust_mps, strongest)),
            energy_factor=1.0 + _faded(cold),
            error_mps=_faded(self.error_mps),
            grid=self.grid,
        )

    def field_with_deviations(self) -> WindField:
        """The same, with the standard deviation of the wind instead of its error.

        A forecast that states no error has a usual one. After the end of the forecast the deviation
        grows to `CLIMATE_MPS`, that of the wind without a forecast.
        """
        error_mps = np.where(self.error_mps > 0.0, self.error_mps, FORECAST_ERROR_MPS)
        last = error_mps[-1:] ** 2
        later = [np.sqrt(share**2 * last + (1 - share**2) * CLIMATE_MPS**2) for share in FADING]
        return replace(self.field(), error_mps=np.concatenate((error_mps, *later)))

    def mean_temperature_c(self, at_s: float) -> float:
        """The mean of all places at a moment, degrees Celsius; it fades to mild as the wind fades.

        Before the first time it is mild.
        """
        periods = len(self.edges_s) - 1
        late_s = at_s - float(self.edges_s[-1])
        period = int(np.searchsorted(self.edges_s, at_s, side="right")) - 1
        faded = int(late_s // FADING_S) if late_s >= 0 else None
        if period < 0 or (faded is not None and faded >= len(FADING)):
            return MILD_C
        left = 1.0 if faded is None else FADING[faded]
        return MILD_C + left * (float(self.temperature_c[min(period, periods - 1)].mean()) - MILD_C)

    @cached_property
    def is_still(self) -> bool:
        """Whether flights need as much time and energy as in still air, and are allowed."""
        wind = self.field()
        return not (wind.gust_mps.any() or wind.error_mps.any() or (wind.energy_factor > 1).any())

    @property
    def strongest_mps(self) -> float:
        """The strongest wind plus its standard error, at any place and time; gusts do not count."""
        return float((np.hypot(self.east_mps, self.north_mps) + self.error_mps).max())

    def farthest_m(self, network: Network) -> tuple[int, float]:
        """The row of the station that is farthest from the forecast, and its distance in metres.

        The distance to a grid is the distance to its border, and 0 within it.
        """
        at_deg = network.columns.longitude_deg, network.columns.latitude_deg
        if self.grid is None:
            _, far_m = nearest_places(self.field(), longitude_deg=at_deg[0], latitude_deg=at_deg[1])
            apart_m = far_m.min(axis=0)
        else:
            columns_deg = longitude_axis(self.longitude_deg[: self.grid[1]])
            middle_deg = (columns_deg[0] + columns_deg[-1]) / 2
            beyond = [
                np.maximum(np.maximum(axis.min() - at, at - axis.max()), 0.0)
                for axis, at in (
                    (columns_deg, beside_deg(at_deg[0], middle_deg)),
                    (self.latitude_deg, at_deg[1]),
                )
            ]
            stretch = np.cos(np.radians(at_deg[1]))
            apart_m = np.radians(EARTH_RADIUS_M) * np.hypot(beyond[0] * stretch, beyond[1])
        row = int(apart_m.argmax())
        return row, float(apart_m[row])


def planned_weather(wind: SegmentWind, model: DroneModel) -> Weather:
    """The weather in which drones of this model are planned, by the clock of the wind.

    A segment is closed while the gusts, which are at least the wind, are above the model's limit.
    A tail wind saves time, but no plan counts on the energy that it saves.
    """
    limit_mps = np.inf if model.max_wind_mps is None else model.max_wind_mps
    return without_savings(wind.weather(model, limit_mps=limit_mps))


def weather_at_risk(wind: SegmentWind, model: DroneModel, risk: EnergyRisk) -> Weather:
    """The weather in which drones of this model are planned at this risk; it has no end.

    `wind` is that of `Forecast.field_with_deviations`. Flights take as long as in the wind of the
    forecast. Their energy has the margin of the risk without `own_margin`, which the drone's model
    has already. Before and after the forecast the air is still, and flights have the margin that
    they have without a forecast.
    """
    weather = planned_weather(wind.without_error(), model)
    own = 1 + risk.own_margin
    margin = (1 + risk.margins(wind.in_error(model, risk.deviations))) / own
    factor = rounded_factor(weather.energy_factor * np.maximum(margin, 1.0))
    edges_s, n = weather.edges_s, len(weather.segment)
    still = rounded_factor(np.full((1, n), (1 + risk.climate_margin(model)) / own))
    as_long = np.ones((1, n))
    return replace(
        weather,
        edges_s=np.concatenate(([edges_s[0] - _LONG_BEFORE_S], edges_s, [np.inf])),
        time_factor=np.concatenate((as_long, weather.time_factor, as_long)),
        energy_factor=np.concatenate((still, np.minimum(factor, LARGEST_FACTOR), still)),
    )


def _faded(deviation: Floats) -> Floats:
    """``(p + f, k)``: the deviation from still air in p periods, and in f that fade."""
    return np.concatenate((deviation, *(share * deviation[-1:] for share in FADING)))
