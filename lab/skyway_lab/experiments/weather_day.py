"""Kinds of days with wind and cold, and a plan that is flown on such a day without new plans."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from random import Random
from typing import Final, Self

import numpy as np

from skyway.delivery.plan import Fly, Plan, Recharge, Wait
from skyway.drone.charging import model_in_cold, model_on_pad, recharge_time_s
from skyway.drone.flight import flight_power_w, flight_time_s
from skyway.drone.model import ChargePoint, DroneModel
from skyway.geo import bearing_rad
from skyway.network.network import Network
from skyway.planner.forecast import Forecast, planned_weather
from skyway.planner.kernels.memory import Floats
from skyway.planner.problem import Problem
from skyway.planner.weather import Weather
from skyway.planner.wind import SegmentWind
from skyway.units import hours_to_s

#: Least ground speed as a share of the air speed, as in the simulator of drones.
_LEAST_SHARE: Final = 0.1

#: A forecast of the experiment holds for so long: longer than any delivery takes.
_FORECAST_S: Final = hours_to_s(72)

#: East and north, metres per second.
Velocity = tuple[float, float]


@dataclass(frozen=True, slots=True)
class KindOfDay:
    """How strong wind and cold are; the scenario with the same name has the same values.

    `gust_mps` is the standard deviation of each component of the wind. Gusts that are `gust_span_m`
    or `gust_span_s` apart are nearly independent. `capacity` is the share of the battery's energy
    that is left. `power_noise` is the standard deviation of a flight's power, as a share. Half of
    its variance is the same for all flights of a delivery.
    """

    mean_mps: float
    gust_mps: float
    gust_span_m: float = 3_000.0
    gust_span_s: float = 600.0
    temperature_c: float = 25.0
    capacity: float = 1.0
    power_noise: float = 0.0

    def true_model(self, model: DroneModel) -> DroneModel:
        """The drone as it flies on such a day: its battery holds less, and charges slowly."""
        cold = model_in_cold(model, self.temperature_c).charge_curve
        curve = tuple(ChargePoint(point.time_s * self.capacity, point.soc) for point in cold)
        changes = {"battery_j": model.battery_j * self.capacity, "charge_curve": curve}
        # A new model: `model_copy` would keep what was derived from the old curve.
        return DroneModel(**{**model.model_dump(), **changes})

    def forecast(self, network: Network, wind_mps: Velocity) -> Forecast:
        """The forecast of this mean wind for all places; gusts count as its standard error."""
        columns = network.columns

        def everywhere(value: float) -> Floats:
            return np.full((1, 1), value)

        return Forecast(
            longitude_deg=np.array([columns.longitude_deg.mean()]),
            latitude_deg=np.array([columns.latitude_deg.mean()]),
            edges_s=np.array([0.0, _FORECAST_S]),
            east_mps=everywhere(wind_mps[0]),
            north_mps=everywhere(wind_mps[1]),
            gust_mps=everywhere(math.hypot(*wind_mps)),
            temperature_c=everywhere(self.temperature_c),
            error_mps=everywhere(self.gust_mps),
        )

    def planned_weather(self, network: Network, model: DroneModel, wind_mps: Velocity) -> Weather:
        """The weather in which a network plans with the forecast of this wind."""
        forecast = self.forecast(network, wind_mps)
        return planned_weather(SegmentWind.of(network, forecast.field()), model)


#: The simulator's days of these names.
DAYS: Final[Mapping[str, KindOfDay]] = {
    "windy": KindOfDay(3.5, 1.2, gust_span_m=4_000.0, gust_span_s=900.0, power_noise=0.03),
    "cold": KindOfDay(
        2.0,
        0.6,
        temperature_c=-8.0,
        capacity=0.88,
        power_noise=0.03,
    ),
    "stormy": KindOfDay(8.0, 3.0, gust_span_m=2_500.0, gust_span_s=400.0, power_noise=0.06),
}


@dataclass(slots=True)
class WeatherDay:
    """What one delivery meets by chance: the mean wind, gusts, and the drone's energy use."""

    kind: KindOfDay
    random: Random
    wind_mps: Velocity
    energy_use: float
    _gust_mps: Velocity
    _felt_s: float = 0.0

    @classmethod
    def of(cls, kind: KindOfDay, random: Random) -> Self:
        """A random day of this kind; the mean wind comes from any direction."""
        to_rad = random.uniform(0.0, math.tau)
        return cls(
            kind,
            random,
            wind_mps=(kind.mean_mps * math.sin(to_rad), kind.mean_mps * math.cos(to_rad)),
            energy_use=random.gauss(1.0, kind.power_noise / math.sqrt(2)),
            _gust_mps=(random.gauss(0.0, kind.gust_mps), random.gauss(0.0, kind.gust_mps)),
        )

    def power_factor(self) -> float:
        """How many times the model's power a flight takes."""
        noise = self.kind.power_noise / math.sqrt(2)
        return max(0.1, self.energy_use + self.random.gauss(0.0, noise))

    def flight_s(self, still_s: float, *, length_m: float, bearing: float, at_s: float) -> float:
        """How long a flight over this segment takes; the drone holds its track."""
        count = max(1, math.ceil(length_m / self.kind.gust_span_m))
        air_mps, elapsed_s = length_m / still_s, 0.0
        for _ in range(count):
            self._blow(length_m / count, at_s + elapsed_s)
            east, north = (a + b for a, b in zip(self.wind_mps, self._gust_mps, strict=True))
            elapsed_s += still_s / count * _slowness(air_mps, bearing, (east, north))
        return elapsed_s

    def _blow(self, moved_m: float, at_s: float) -> None:
        """Change the gusts for the next stretch: a part of the last ones stays."""
        apart = (moved_m / self.kind.gust_span_m) ** 2
        apart += ((at_s - self._felt_s) / self.kind.gust_span_s) ** 2
        kept = math.exp(-apart / 2)
        new_mps = self.kind.gust_mps * math.sqrt(1.0 - kept * kept)
        east, north = (kept * each + self.random.gauss(0.0, new_mps) for each in self._gust_mps)
        self._gust_mps, self._felt_s = (east, north), at_s


def _slowness(air_mps: float, bearing: float, wind_mps: Velocity) -> float:
    """How many times longer a stretch takes in this wind (the wind triangle)."""
    along = wind_mps[0] * math.sin(bearing) + wind_mps[1] * math.cos(bearing)
    across = wind_mps[0] * math.cos(bearing) - wind_mps[1] * math.sin(bearing)
    held = math.sqrt(max(0.0, air_mps**2 - across**2))
    return air_mps / max(_LEAST_SHARE * air_mps, held + along)


@dataclass(frozen=True, slots=True)
class FlownDelivery:
    """When the last package came, and the charge after each landing."""

    delivered_s: float
    landing_socs: tuple[float, ...]


def fly_in_weather(problem: Problem, plan: Plan, day: WeatherDay) -> FlownDelivery:
    """Fly the plan as it stands.

    The drone begins no step on the ground before its planned time, and charges until the planned
    charge. An empty battery stays at 0, so that each delivery has a time. `problem` holds the drone
    as its data sheet describes it.
    """
    model = day.kind.true_model(problem.drone.model)
    now_s, soc, stands = 0.0, problem.drone.soc, True
    socs: list[float] = []
    for step, following in zip(plan.steps, (*plan.steps[1:], None), strict=True):
        now_s = max(now_s, step.start_s) if stands else now_s
        stands = not isinstance(step, Fly) or not isinstance(following, Fly)
        match step:
            case Fly():
                flight_s = _flight_s(problem.network, model, step, day=day, at_s=now_s)
                power_w = flight_power_w(model, step.load_kg) * day.power_factor()
                used_j = power_w * flight_s + (model.stop_j if stands else 0.0)
                now_s += flight_s + (model.stop_s if stands else 0.0)
                soc = max(0.0, soc - used_j / model.battery_j)
                socs += [soc] if stands else []
            case Recharge():
                now_s += _charging_s(model_on_pad(model, step.power_w), soc, step.soc_end)
                soc = max(soc, step.soc_end)
            case Wait():
                now_s = max(now_s, step.end_s)
            case _:
                now_s += step.end_s - step.start_s
    return FlownDelivery(now_s, tuple(socs))


def _flight_s(
    network: Network, model: DroneModel, step: Fly, *, day: WeatherDay, at_s: float
) -> float:
    length_m = next(
        each.length_m for each in network.segments_from(step.from_id) if each.to_id == step.to_id
    )
    ends = network.stations[step.from_id].position, network.stations[step.to_id].position
    return day.flight_s(
        flight_time_s(model, length_m=length_m, load_kg=step.load_kg),
        length_m=length_m,
        bearing=bearing_rad(*ends),
        at_s=at_s,
    )


def _charging_s(model: DroneModel, soc: float, until_soc: float) -> float:
    if soc >= until_soc:
        return 0.0
    return recharge_time_s(model, max(soc, model.charge_curve[0].soc), until_soc)
