"""One simulated flight: its position and used energy at each moment."""

import math
from bisect import bisect_right
from dataclasses import dataclass
from datetime import datetime, timedelta

from skyway.contracts.flight_step import FlyStep
from skyway.drone.flight import flight_energy_j, flight_time_s
from skyway.drone.model import DroneModel
from skyway.geo import Position, bearing_rad, moved, point_between
from skyway.ids import DroneId
from skyway_drone_agent.analysis.flight_estimates import ground_speed_mps
from skyway_drone_agent.simulated.disturbances import Disturbances, FlightFault, happens, normals
from skyway_drone_agent.simulated.wind_field import wind_field

#: Stretches of constant wind per span of gusts, and the most stretches of a flight.
_STRETCHES_PER_SPAN, _MOST_STRETCHES = 4, 60


@dataclass(frozen=True, slots=True)
class SimulatedFlight:
    """The way of one flight, without its landing, as a function of the seconds since take-off.

    `ends_s` are the ends of equally long stretches, each flown at one speed. The power is constant,
    times `failed_power_factor` once a motor has failed.
    """

    step: FlyStep
    started_at: datetime
    ends_s: tuple[float, ...]
    still_s: float
    still_j: float
    motor_fails_s: float | None
    failed_power_factor: float
    gps_lost_s: tuple[float, float] | None
    strays: tuple[float, float] | None

    @property
    def way_s(self) -> float:
        """How long the way takes, without a landing."""
        return self.ends_s[-1]

    @property
    def over_at(self) -> datetime:
        """When the drone is over the end of the segment."""
        return self.started_at + timedelta(seconds=self.way_s)

    def used_j(self, elapsed_s: float) -> float:
        """The energy that the way has used by then."""
        flown_s = min(elapsed_s, self.way_s)
        energy_j = self.still_j * (flown_s / self.still_s)
        if self.motor_fails_s is not None and flown_s > self.motor_fails_s:
            lame_s = flown_s - self.motor_fails_s
            energy_j += (self.failed_power_factor - 1) * self.still_j * (lame_s / self.still_s)
        return energy_j

    def power_w(self, elapsed_s: float) -> float:
        """The power drawn on the way at that moment."""
        power_w = self.still_j / self.still_s
        return power_w if self.motors_work(elapsed_s) else power_w * self.failed_power_factor

    def speed_mps(self, elapsed_s: float) -> float:
        """Speed over ground; 0 over the end."""
        if elapsed_s >= self.way_s:
            return 0.0
        stretch = bisect_right(self.ends_s, elapsed_s)
        begun_s = self.ends_s[stretch - 1] if stretch else 0.0
        return self.step.length_m / len(self.ends_s) / (self.ends_s[stretch] - begun_s)

    def position(self, elapsed_s: float) -> Position:
        """The position of the drone, with its drift."""
        start, end = self.step.from_position, self.step.to_position
        fraction = self._fraction(elapsed_s)
        on_track = point_between(start, end, fraction=fraction)
        if self.strays is None:
            return on_track
        after_s, most_m = self.strays
        left = self._fraction(after_s)
        if not left < fraction < 1.0:
            return on_track
        aside_m = most_m * math.sin(math.pi * (fraction - left) / (1.0 - left))
        to_right = bearing_rad(start, end) + math.pi / 2
        return moved(
            on_track, east_m=aside_m * math.sin(to_right), north_m=aside_m * math.cos(to_right)
        )

    def motors_work(self, elapsed_s: float) -> bool:
        """Whether no motor has failed yet."""
        return self.motor_fails_s is None or elapsed_s < self.motor_fails_s

    def position_shown(self, elapsed_s: float) -> tuple[Position, bool]:
        """The position that the GPS shows, and whether the GPS works."""
        if self.gps_lost_s is not None:
            lost_s, found_s = self.gps_lost_s
            if lost_s <= elapsed_s < found_s:
                return self.position(lost_s), False
        return self.position(elapsed_s), True

    def _fraction(self, elapsed_s: float) -> float:
        if elapsed_s >= self.way_s:
            return 1.0
        stretch = bisect_right(self.ends_s, elapsed_s)
        begun_s = self.ends_s[stretch - 1] if stretch else 0.0
        share = (elapsed_s - begun_s) / (self.ends_s[stretch] - begun_s)
        return (stretch + share) / len(self.ends_s)


def flight_of(
    step: FlyStep,
    started_at: datetime,
    *,
    load_kg: float,
    model: DroneModel,
    disturbed: Disturbances,
    drone_id: DroneId,
) -> SimulatedFlight:
    """The flight of this drone that takes off at that moment."""
    still_s = flight_time_s(model, length_m=step.length_m, load_kg=load_kg)
    still_s *= disturbed.flight_time_factor
    still_j = flight_energy_j(model, length_m=step.length_m, load_kg=load_kg)
    still_j *= disturbed.flight_energy_factor * _energy_factor(disturbed, drone_id, started_at)
    motor, gps, drift = disturbed.motor, disturbed.gps, disturbed.drift

    def befalls(fault: FlightFault, name: str) -> bool:
        is_meant = fault.drone_ids is None or drone_id in fault.drone_ids
        return is_meant and happens(fault.share, disturbed.seed, name, drone_id, started_at)

    return SimulatedFlight(
        step=step,
        started_at=started_at,
        ends_s=_ends_s(step, started_at, still_s=still_s, disturbed=disturbed),
        still_s=still_s,
        still_j=still_j,
        motor_fails_s=motor.after_s if befalls(motor, "motor") else None,
        failed_power_factor=motor.power_factor,
        gps_lost_s=(gps.after_s, gps.after_s + gps.for_s) if befalls(gps, "gps") else None,
        strays=(drift.after_s, drift.most_m) if befalls(drift, "drift") else None,
    )


def _energy_factor(disturbed: Disturbances, drone_id: DroneId, started_at: datetime) -> float:
    """Power of this flight by the model's: half the drone's own factor, half chance."""
    if disturbed.power_noise == 0.0:
        return 1.0
    own = normals(disturbed.seed, "power", drone_id)[0]
    chance = normals(disturbed.seed, "power", drone_id, started_at)[0]
    return max(0.1, 1.0 + disturbed.power_noise * (own + chance) / math.sqrt(2.0))


def _ends_s(
    step: FlyStep, started_at: datetime, *, still_s: float, disturbed: Disturbances
) -> tuple[float, ...]:
    """When each stretch ends; the wind triangle gives the ground speed on the track."""
    if not disturbed.wind.blows:
        return (still_s,)
    field, span_m = wind_field(disturbed.wind, disturbed.seed), disturbed.wind.gust_span_m
    count = min(_MOST_STRETCHES, math.ceil(step.length_m / span_m * _STRETCHES_PER_SPAN))
    air_mps, bearing = step.length_m / still_s, bearing_rad(step.from_position, step.to_position)
    ends_s: list[float] = []
    elapsed_s = 0.0
    for stretch in range(count):
        middle = point_between(
            step.from_position, step.to_position, fraction=(stretch + 0.5) / count
        )
        wind_mps = field.at(middle, started_at + timedelta(seconds=elapsed_s))
        elapsed_s += step.length_m / count / ground_speed_mps(air_mps, bearing, wind_mps)
        ends_s.append(elapsed_s)
    return tuple(ends_s)
