"""The sensors of a simulated drone: what its physics looks like to a battery monitor and a GPS."""

import math
from datetime import datetime
from typing import Final

from skyway.contracts.flight_step import FlyStep
from skyway.drone.model import DroneModel
from skyway.geo import bearing_rad
from skyway_drone_agent.battery_pack import BatteryPack
from skyway_drone_agent.reading import Reading
from skyway_drone_agent.vehicle import Sample, Standing, StepRun

#: A calm day's battery.
_TEMPERATURE_C: Final = 25.0


def reading_of(
    sample: Sample, doing: StepRun | Standing, *, model: DroneModel, at: datetime
) -> Reading:
    """The readings that show this sample exactly, without noise or wind."""
    pack = BatteryPack()
    current_a = pack.current_a(sample.soc, sample.power_w)
    voltage_v = pack.open_voltage_v(sample.soc) - current_a * pack.resistance_ohm
    velocity_mps = _velocity_mps(doing, sample.speed_mps)
    return Reading(
        at=at,
        position=sample.position,
        ground_mps=velocity_mps,
        air_mps=velocity_mps,
        voltage_v=voltage_v,
        current_a=current_a,
        consumed_j=(1.0 - sample.soc) * model.battery_j,
        cell_low_v=voltage_v / pack.cells,
        cell_high_v=voltage_v / pack.cells,
        temperature_c=_TEMPERATURE_C,
        load_kg=doing.load_kg,
    )


def _velocity_mps(doing: StepRun | Standing, speed_mps: float) -> tuple[float, float]:
    if isinstance(doing, Standing) or not isinstance(doing.step, FlyStep):
        return 0.0, 0.0
    bearing = bearing_rad(doing.step.from_position, doing.step.to_position)
    return speed_mps * math.sin(bearing), speed_mps * math.cos(bearing)
