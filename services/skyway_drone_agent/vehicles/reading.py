"""One look at a drone's sensors."""

from dataclasses import dataclass
from datetime import datetime

from skyway.geo import Position


@dataclass(frozen=True, slots=True)
class Reading:
    """What the sensors show at a moment of fleet time; without GPS the position is the last known.

    `consumed_j` counts what has left the battery since the vehicle was switched on (charging
    counts backwards), as a battery monitor integrates it between two readings; `current_a` is
    negative while charging. Speeds are vectors, east and north: over ground, and through the air.
    `load_kg` is what the drone weighs above its own mass, None without such a sensor.
    """

    at: datetime
    position: Position
    ground_mps: tuple[float, float]
    air_mps: tuple[float, float]
    voltage_v: float
    current_a: float
    consumed_j: float
    cell_low_v: float
    cell_high_v: float
    temperature_c: float
    load_kg: float | None = None
    has_gps: bool = True
    motors_work: bool = True
    pad_is_free: bool = True

    @property
    def power_w(self) -> float:
        """What is drawn from the battery now."""
        return self.voltage_v * self.current_a
