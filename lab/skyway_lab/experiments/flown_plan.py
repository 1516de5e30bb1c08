"""A plan flown on a day with disturbances: when it delivers, and how far the battery falls.

Disturbances are not part of the plan: power noise, wind, and pads that become free late.
"""

import math
from dataclasses import dataclass
from random import Random
from typing import Self

from skyway.delivery.plan import Fly, Plan, Recharge, Wait
from skyway.drone.charging import model_on_pad, recharge_time_s
from skyway.drone.flight import flight_power_w, speed_mps
from skyway.drone.model import DroneModel
from skyway.geo import Position, bearing_rad
from skyway.planner.problem import Problem
from skyway.units import minutes_to_s

#: The slowest ground speed, as a share of the air speed, that a head wind leaves. Our own choice.
_SLOWEST_SHARE = 0.2


@dataclass(frozen=True, slots=True)
class Climate:
    """How strong the disturbances are; all three are our own choice.

    `power_noise` is the standard deviation of a segment's power as a share of the model's, half of
    it the same for the whole flight; `wind_mps` the mean wind; `late_share` the share of sessions
    whose pad is still held when they should begin, for `late_s` on average.
    """

    power_noise: float = 0.0
    wind_mps: float = 0.0
    late_share: float = 0.0
    late_s: float = minutes_to_s(10)


@dataclass(slots=True)
class Day:
    """One flight's chance: a constant wind, the drone's own energy use, and noise on the way."""

    climate: Climate
    random: Random
    wind_mps: float
    wind_to_rad: float
    energy_use: float

    @classmethod
    def of(cls, climate: Climate, random: Random) -> Self:
        """The day that this chance draws; wind speeds follow Rayleigh's distribution."""
        scale = climate.wind_mps / math.sqrt(math.pi / 2)
        noise = climate.power_noise / math.sqrt(2)
        return cls(
            climate,
            random,
            wind_mps=scale * math.sqrt(-2 * math.log(1 - random.random())),
            wind_to_rad=random.uniform(0, 2 * math.pi),
            energy_use=random.gauss(1.0, noise),
        )

    def slowness(self, start: Position, end: Position, *, air_speed_mps: float) -> float:
        """How many times longer the segment takes in this wind; the drone holds its track."""
        turn = self.wind_to_rad - bearing_rad(start, end)
        along_mps = self.wind_mps * math.cos(turn)
        across_mps = self.wind_mps * math.sin(turn)
        still_mps = math.sqrt(max(0.0, air_speed_mps**2 - across_mps**2))
        ground_mps = max(_SLOWEST_SHARE * air_speed_mps, still_mps + along_mps)
        return air_speed_mps / ground_mps

    def power_factor(self) -> float:
        """How many times the model's power this segment takes."""
        noise = self.climate.power_noise / math.sqrt(2)
        return max(0.0, self.energy_use + self.random.gauss(0.0, noise))

    def pad_delay_s(self) -> float:
        """How long the pad is still held when the session should begin."""
        if self.random.random() >= self.climate.late_share:
            return 0.0
        return self.random.expovariate(1 / self.climate.late_s)


@dataclass(frozen=True, slots=True)
class FlightResult:
    """The moment of the last delivery, and the lowest charge on the way."""

    delivered_s: float
    lowest_soc: float


def fly_plan(problem: Problem, plan: Plan, day: Day) -> FlightResult:
    """Fly the plan as it stands, without replanning.

    A session begins at its planned time, or when drone and pad are ready, and lasts until the
    planned charge. An empty battery stays at 0: such a flight counts as below the reserve, and goes
    on so that it has a time. `problem` holds the true drone; the plan may have been made for a
    drone that uses more energy.
    """
    model = problem.drone.model
    now_s, soc, lowest_soc = 0.0, problem.drone.soc, problem.drone.soc
    for step in plan.steps:
        if isinstance(step, Fly):
            flight_s = _flight_s(problem, step, day)
            power_w = flight_power_w(model, step.load_kg) * day.power_factor()
            soc = max(0.0, soc - power_w * flight_s / model.battery_j)
            now_s, lowest_soc = now_s + flight_s, min(lowest_soc, soc)
        elif isinstance(step, Recharge):
            now_s = max(now_s, step.start_s) + day.pad_delay_s()
            now_s += _charging_s(model_on_pad(model, step.power_w), soc, step.soc_end)
            soc = max(soc, step.soc_end)
        elif isinstance(step, Wait):
            now_s = max(now_s, step.end_s)
        else:
            now_s += step.end_s - step.start_s
    return FlightResult(now_s, lowest_soc)


def _flight_s(problem: Problem, step: Fly, day: Day) -> float:
    stations = problem.network.stations
    slowness = day.slowness(
        stations[step.from_id].position,
        stations[step.to_id].position,
        air_speed_mps=speed_mps(problem.drone.model, step.load_kg),
    )
    return (step.end_s - step.start_s) * slowness


def _charging_s(model: DroneModel, soc: float, until_soc: float) -> float:
    if soc >= until_soc:
        return 0.0
    return recharge_time_s(model, max(soc, model.charge_curve[0].soc), until_soc)
