"""A simulated drone and its sensors, with the physics (`skyway.drone`) that the planner uses."""

import asyncio
import math
from dataclasses import replace
from datetime import datetime
from functools import lru_cache
from pathlib import Path
from typing import Final

from skyway.contracts.flight_step import FlyStep, PickUpStep, RechargeStep
from skyway.drone.model import DroneModel
from skyway.geo import Position, bearing_rad, moved
from skyway.ids import DroneId
from skyway.runtime.clock import FleetClock
from skyway_drone_agent.simulated.disturbances import UNDISTURBED, Disturbances, normals
from skyway_drone_agent.simulated.physics import Physics
from skyway_drone_agent.simulated.wind_field import wind_field
from skyway_drone_agent.vehicle import BatteryPack, Outcome, Reading, Sample, Standing, StepRun

_PACK: Final = BatteryPack()

#: What the camera of a simulated drone shows.
_PICTURE: Final = Path(__file__).parent / "hand_over.jpg"

#: The drone id for chance where no drone is named.
_NO_DRONE: Final = DroneId("")


class SimulatedVehicle:
    """Performs a step by computing when it ends, and waiting until then."""

    def __init__(
        self,
        model: DroneModel,
        clock: FleetClock,
        *,
        disturbances: Disturbances = UNDISTURBED,
        drone_id: DroneId = _NO_DRONE,
    ) -> None:
        self._physics = Physics(model, disturbances, drone_id=drone_id)
        self._clock = clock

    @property
    def model(self) -> DroneModel:
        """The type of drone."""
        return self._physics.model

    async def perform(self, run: StepRun) -> Outcome:
        """Wait until the step's computed end; a late wake-up does not change that end."""
        if _awaits_confirmation(run):
            # A loader confirms to the cloud; then the cloud sends an instruction.
            await asyncio.Event().wait()
        outcome = self._physics.outcome_of(run)
        await self._clock.sleep_until(outcome.ended_at)
        return outcome

    def cut(self, run: StepRun, at: datetime) -> Outcome:
        """End a step on the ground at this moment, or earlier if it ended by itself."""
        if not _awaits_confirmation(run):
            at = min(at, self._physics.outcome_of(run).ended_at)
        return Outcome(at, self._physics.sample(run, at).soc, energy_j=0.0, code="CUT")

    def sample(self, run: StepRun, at: datetime) -> Sample:
        """The progress of the step at this moment."""
        return self._physics.sample(run, at)

    def read(self, doing: StepRun | Standing, at: datetime) -> Reading:
        """What the sensors show at this moment."""
        return reading_of(self._physics, doing, at)

    async def land(self, run: StepRun) -> Outcome:
        """End a flight on the spot, and return once the drone is down."""
        outcome = self._physics.landed(run, self._clock.now())
        await self._clock.sleep_until(outcome.ended_at)
        return outcome

    def recall(self, run: StepRun) -> bool | None:
        """Whether the computed end has passed, which a restart does not change."""
        outcome = self._physics.outcome_of(run)
        return outcome.ended_at <= self._clock.now() and not outcome.has_failed

    async def photograph(self) -> bytes:
        """A small grey picture."""
        return await asyncio.to_thread(_PICTURE.read_bytes)


def _awaits_confirmation(run: StepRun) -> bool:
    return isinstance(run.step, PickUpStep) and run.step.awaits_confirmation


def reading_of(physics: Physics, doing: StepRun | Standing, at: datetime) -> Reading:
    """What the sensors show at this moment; without disturbances the true values."""
    true = _true_reading(physics, doing, at)
    if isinstance(doing, StepRun):
        true = _with_faults(true, doing, physics=physics, at=at)
    if not physics.disturbances.sensors.err:
        return true
    return _with_noise(true, physics.disturbances, drone_id=physics.drone_id)


def _sample_of(physics: Physics, doing: StepRun | Standing, at: datetime) -> Sample:
    if isinstance(doing, StepRun):
        return physics.sample(doing, at)
    return Sample(doing.position, doing.soc, power_w=0.0, speed_mps=0.0)


def _true_reading(physics: Physics, doing: StepRun | Standing, at: datetime) -> Reading:
    sample = _sample_of(physics, doing, at)
    ground_mps = _velocity_mps(doing, sample.speed_mps)
    battery, sensors = physics.disturbances.battery, physics.disturbances.sensors
    pack, spread_v = _PACK, 0.0
    if physics.is_worn:
        pack = replace(pack, resistance_ohm=pack.resistance_ohm * battery.resistance_factor)
        spread_v = battery.cell_spread_v
    gain = 1.0
    if sensors.current_share:
        gain += sensors.current_share * _own_gain(physics.disturbances.seed, physics.drone_id)
    current_a = pack.current_a(sample.soc, sample.power_w)
    voltage_v = pack.open_voltage_v(sample.soc) - current_a * pack.resistance_ohm
    return Reading(
        at=at,
        position=sample.position,
        ground_mps=ground_mps,
        air_mps=_air_mps(physics.disturbances, ground_mps, position=sample.position, at=at),
        voltage_v=voltage_v,
        current_a=current_a * gain,
        consumed_j=(1.0 - sample.soc) * physics.battery_j * gain,
        cell_low_v=voltage_v / pack.cells - spread_v / 2,
        cell_high_v=voltage_v / pack.cells + spread_v / 2,
        temperature_c=battery.temperature_c,
        load_kg=doing.load_kg,
    )


@lru_cache(maxsize=8192)
def _own_gain(seed: int, drone_id: DroneId) -> float:
    """The gain error of this drone's current sensor, in standard deviations."""
    return normals(seed, "current", drone_id)[0]


def _velocity_mps(doing: StepRun | Standing, speed_mps: float) -> tuple[float, float]:
    if isinstance(doing, Standing) or not isinstance(doing.step, FlyStep):
        return 0.0, 0.0
    bearing = bearing_rad(doing.step.from_position, doing.step.to_position)
    return speed_mps * math.sin(bearing), speed_mps * math.cos(bearing)


def _air_mps(
    disturbed: Disturbances, ground_mps: tuple[float, float], *, position: Position, at: datetime
) -> tuple[float, float]:
    if not disturbed.wind.blows:
        return ground_mps
    east_mps, north_mps = wind_field(disturbed.wind, disturbed.seed).at(position, at)
    return ground_mps[0] - east_mps, ground_mps[1] - north_mps


def _with_faults(true: Reading, run: StepRun, *, physics: Physics, at: datetime) -> Reading:
    if isinstance(run.step, RechargeStep):
        return replace(true, pad_is_free=at >= physics.pad_free_at(run, run.step))
    if not isinstance(run.step, FlyStep):
        return true
    flight = physics.flight(run, run.step)
    if flight.gps_lost_s is None and flight.motor_fails_s is None:
        return true
    elapsed_s = max(0.0, (at - run.started_at).total_seconds())
    position, has_gps = flight.position_shown(elapsed_s)
    return replace(
        true, position=position, has_gps=has_gps, motors_work=flight.motors_work(elapsed_s)
    )


def _with_noise(true: Reading, disturbed: Disturbances, *, drone_id: DroneId) -> Reading:
    """The reading with the errors of this second; a repeated reading has the same errors."""
    sensors = disturbed.sensors
    second = int(true.at.timestamp())
    volts, warmth, east, north, air_east, air_north, *_ = normals(
        disturbed.seed, "sensors", drone_id, second
    )
    voltage_v = max(0.0, true.voltage_v + volts * sensors.voltage_v)
    cell_v = (voltage_v - true.voltage_v) / _PACK.cells
    return replace(
        true,
        position=moved(true.position, east_m=east * sensors.gps_m, north_m=north * sensors.gps_m)
        if true.has_gps
        else true.position,
        air_mps=(
            true.air_mps[0] + air_east * sensors.air_speed_mps,
            true.air_mps[1] + air_north * sensors.air_speed_mps,
        ),
        voltage_v=voltage_v,
        cell_low_v=true.cell_low_v + cell_v,
        cell_high_v=true.cell_high_v + cell_v,
        temperature_c=true.temperature_c + warmth * sensors.temperature_c,
    )
