"""The forecast with which a network plans, and the weather of its segments for each drone model."""

import asyncio
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from skyway.contracts.weather import (
    MEASURED,
    ForecastDocument,
    MeasuredWind,
    WeatherInForce,
    WeatherNote,
)
from skyway.delivery.lateness import KnownBy
from skyway.delivery.plan import Fly
from skyway.drone.learned_values import DEVIATION_BOUNDS, UNKNOWN_USE
from skyway.drone.model import DroneModel
from skyway.ids import NetworkId
from skyway.network.network import Network
from skyway.planner.energy_risk import EnergyRisk
from skyway.planner.forecast import (
    FADING,
    FADING_S,
    Forecast,
    planned_weather,
    weather_at_risk,
)
from skyway.planner.known_air import AirOfPlan, air_in_forecast
from skyway.planner.measured_wind import corrected
from skyway.planner.weather import Weather, segment_rows
from skyway.planner.wind import SegmentWind
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition.closures.read_forecast import (
    MOST_FACTORS,
    edges_s,
    forecast_of,
    place_count,
)

#: The most time factors that are cached, of all drone models. With as many energy factors they take
#: 384 MB.
MOST_CACHED: Final = 24_000_000
#: If the weather of fewer drones than this fits into the cache, plans round the deviation of the
#: energy use up to one of `_FEW_DEVIATIONS`. Otherwise the weather of each deviation would be
#: computed again and again.
_MANY_DRONES: Final = 50
_FEW_DEVIATIONS: Final = (0.04, UNKNOWN_USE, 0.14, DEVIATION_BOUNDS[1])


class ForecastRow(NamedTuple):
    """A forecast as it is stored: JSON of a `ForecastDocument`, and of a `MeasuredWind`."""

    network_id: NetworkId
    sha256: str
    received_ms: int
    content: bytes
    measured: str | None = None


@dataclass(frozen=True, slots=True)
class StoredForecast:
    """The forecast of a network, with what is stored about it."""

    network_id: NetworkId
    sha256: str
    received_ms: int
    document: ForecastDocument
    measured: MeasuredWind | None = None

    @classmethod
    def read(cls, row: ForecastRow) -> "StoredForecast":
        """The forecast of a row."""
        document = ForecastDocument.read(row.content)
        measured = None if row.measured is None else MeasuredWind.read(row.measured)
        return cls(row.network_id, row.sha256, row.received_ms, document, measured)

    @property
    def is_measured(self) -> bool:
        """Whether this is the air as drones measured it, in a network without a forecast."""
        return self.document.source == MEASURED

    @property
    def note(self) -> WeatherNote:
        """What plans say about the forecast they were made with."""
        return WeatherNote(source=self.document.source, issued_at=self.document.issued_at)

    def in_force(self, *, now_ms: int) -> WeatherInForce:
        """The forecast as it is shown at this moment of fleet time."""
        edges_ms = [round(each * 1000) for each in edges_s(self.document)]
        over_ms = edges_ms[-1] + round(len(FADING) * FADING_S * 1000)
        issued_ms = moment_to_ms(self.document.issued_at)
        return WeatherInForce(
            network_id=self.network_id,
            source=self.document.source,
            issued_at=self.document.issued_at,
            age_s=(now_ms - issued_ms) / 1000,
            received_at=ms_to_moment(self.received_ms),
            sha256=self.sha256,
            phase=(
                "AHEAD"
                if now_ms < edges_ms[0]
                else "VALID"
                if now_ms < edges_ms[-1]
                else "FADING"
                if now_ms < over_ms
                else "OVER"
            ),
            valid_from_at=ms_to_moment(edges_ms[0]),
            valid_until_at=ms_to_moment(edges_ms[-1]),
            fades_until_at=ms_to_moment(over_ms),
            measured_at=None if self.measured is None else self.measured.at,
            places=place_count(self.document),
            times=len(edges_ms) - 1,
        )


@dataclass(slots=True, eq=False)
class NetworkWeather:
    """A network's forecast; the factors of each drone model are computed once, and cached.

    With a `reserve_risk` the factors have the margin for the error of the wind. This margin depends
    on how much a drone's energy use varies: `use_deviation`. The same segments are closed for all.
    """

    stored: StoredForecast
    network: Network
    forecast: Forecast
    reserve_risk: float | None = None
    most_cached: int = MOST_CACHED
    _wind: SegmentWind | None = None
    _of_model: dict[object, Weather] = field(default_factory=dict)

    @classmethod
    def read(
        cls, row: ForecastRow, network: Network, *, reserve_risk: float | None = None
    ) -> "NetworkWeather":
        """The weather that a stored forecast makes in a version of its network."""
        return cls.of(StoredForecast.read(row), network, reserve_risk=reserve_risk)

    @classmethod
    def of(
        cls, stored: StoredForecast, network: Network, *, reserve_risk: float | None = None
    ) -> "NetworkWeather":
        """The weather that a stored forecast makes in a version of its network.

        A version with many more segments than the one for which the forecast was accepted uses only
        as many of its first times as fit.
        """
        forecast = forecast_of(stored.document)
        fitting = max(1, MOST_FACTORS // max(1, len(network.columns.length_m)) - len(FADING))
        forecast = forecast.first(fitting)
        measured = stored.measured
        if measured is not None and measured.places and not stored.is_measured:
            corrections = {place: (east, north) for place, east, north in measured.places}
            at_s = moment_to_ms(measured.at) / 1000
            forecast = corrected(forecast, corrections, at_s=at_s)
        return cls(stored, network, forecast, reserve_risk)

    @property
    def over_ms(self) -> float:
        """When the air counts as still again, fleet milliseconds."""
        return (float(self.forecast.edges_s[-1]) + len(FADING) * FADING_S) * 1000

    def note_at(self, at_ms: int) -> WeatherNote | None:
        """The forecast that a plan from this moment names; None if it is over by then."""
        return self.stored.note if at_ms < self.over_ms else None

    def counts_from(self, at_ms: int) -> bool:
        """Whether plans from this moment differ from plans in still air."""
        if self.reserve_risk is not None:
            return True
        # Planning in weather takes longer, and most networks without a forecast are calm.
        return at_ms < self.over_ms and not self.forecast.is_still

    def least_time_factor(self, model: DroneModel) -> float:
        """A lower bound of the time factors of this model, found without looking at segments.

        No flight is faster than with the faster load and the strongest wind as a tail wind.
        """
        fastest_mps = max(model.speed_empty_mps, model.speed_full_mps)
        strongest_mps = self.forecast.strongest_mps
        return fastest_mps / (fastest_mps + strongest_mps)

    async def of_plan(
        self, model: DroneModel, start_ms: int, *, use_deviation: float = UNKNOWN_USE
    ) -> Weather | None:
        """The weather for a plan from this moment; None if the air is still from then on.

        With a `reserve_risk` never None: after a forecast, flights have the margin without one.
        """
        if not self.counts_from(start_ms):
            return None
        if self._key(model, use_deviation) in self._of_model:
            return self.of_model(model, use_deviation).shifted(-start_ms / 1000)
        found = await asyncio.to_thread(self.of_model, model, use_deviation)
        return found.shifted(-start_ms / 1000)

    def of_model(self, model: DroneModel, use_deviation: float = UNKNOWN_USE) -> Weather:
        """The weather for drones of this model, by seconds of fleet time since 1970."""
        key = self._key(model, use_deviation)
        found = self._of_model.get(key)
        if found is None:
            if self.reserve_risk is None:
                found = planned_weather(self._on_segments(), model)
            else:
                risk = EnergyRisk(self.reserve_risk, use_deviation)
                found = weather_at_risk(self._on_segments(), model, risk)
            most = max(1, self.most_cached // max(1, found.time_factor.size))
            for oldest in list(self._of_model)[: max(0, len(self._of_model) + 1 - most)]:
                self._of_model.pop(oldest, None)
        # At the end of the cache, which is dropped last.
        self._of_model.pop(key, None)
        self._of_model[key] = found
        return found

    def planned_deviation(self, use_deviation: float) -> float:
        """The deviation that plans use for a drone whose energy use has this one; never less."""
        periods = len(self.forecast.edges_s) + len(FADING) + 1
        fitting = self.most_cached // max(1, periods * len(self.network.columns.length_m))
        if fitting >= _MANY_DRONES:
            return use_deviation
        return next((each for each in _FEW_DEVIATIONS if each >= use_deviation), use_deviation)

    def in_error(
        self, model: DroneModel, ends: tuple[str, str], *, at_s: float, risk: EnergyRisk
    ) -> float:
        """`in_wind` of `EnergyRisk.margins`, for a flight that begins at a moment on a segment."""
        segment = int(segment_rows(self.network, [ends])[0])
        wind = self._on_segments().at(segment, at_s)
        if wind is None:
            return risk.in_climate(model)
        return float(wind.in_error(model, risk.deviations)[0, 0])

    def air_of(
        self, model: DroneModel, flights: Sequence[Fly], *, start_ms: int
    ) -> AirOfPlan | None:
        """What is known of the air of a plan with these flights; None if nothing is."""
        if not flights or start_ms >= self.over_ms:
            return None
        wind, start_s = self._on_segments(), start_ms / 1000
        source: KnownBy = "MEASURED" if self.stored.is_measured else "FORECAST"
        return air_in_forecast(self.forecast, wind, model, flights, start_s=start_s, source=source)

    def _on_segments(self) -> SegmentWind:
        if self._wind is None:
            at_risk = self.reserve_risk is not None
            wind = self.forecast.field_with_deviations() if at_risk else self.forecast.field()
            self._wind = SegmentWind.of(self.network, wind)
        return self._wind

    def _key(self, model: DroneModel, use_deviation: float) -> object:
        """What changes the weather of a model; constant margins and learned factors do not."""
        deviation = None if self.reserve_risk is None else use_deviation
        return model.speed_empty_mps, model.speed_full_mps, model.max_wind_mps, deviation


@dataclass(frozen=True, slots=True)
class ClosedNow:
    """How many of all segments the weather closes to a drone model at a moment, and until when."""

    closed: int
    segments: int
    until_ms: int

    @property
    def is_all(self) -> bool:
        """Whether no segment is open."""
        return self.closed == self.segments


def closed_now(weather: Weather, at_ms: int) -> ClosedNow | None:
    """What this weather, by fleet time, closes at a moment; None if it closes nothing.

    `until_ms` is the moment from which the weather closes no segment.
    """
    period = weather.period_at(at_ms / 1000)
    closed = (weather.time_factor == math.inf).sum(axis=1)
    if not 0 < period < len(weather.edges_s) or not closed[period - 1]:
        return None
    last = period
    while last < len(closed) and closed[last]:
        last += 1
    until_ms = round(float(weather.edges_s[last]) * 1000)
    return ClosedNow(int(closed[period - 1]), len(weather.segment), until_ms)
