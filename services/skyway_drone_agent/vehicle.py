"""The drone as the agent sees it: its steps, its sensors, and the interface of a vehicle."""

from dataclasses import dataclass
from datetime import datetime
from typing import Protocol

from skyway.contracts.flight_step import FlightStep, FlyStep
from skyway.drone.model import DroneModel
from skyway.geo import Position
from skyway.ids import StationId


@dataclass(frozen=True, slots=True)
class Reading:
    """What the sensors show at a moment of fleet time; without GPS the position is the last one.

    `consumed_j` counts the energy that left the battery since the vehicle was switched on. Charging
    counts backwards. `current_a` is negative while charging. Speeds are vectors, east and north:
    over ground, and through the air. `load_kg` is the mass on board, None without such a sensor.
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
        """The power drawn from the battery now."""
        return self.voltage_v * self.current_a


@dataclass(frozen=True, slots=True)
class StepRun:
    """A step that has begun, and the drone's state at the beginning.

    `changed_at` is when an instruction last changed the step: it cannot end earlier. `onward` are
    the flights after a flight that does not land, up to the landing.
    """

    step: FlightStep
    started_at: datetime
    soc: float
    load_kg: float
    position: Position
    changed_at: datetime | None = None
    onward: tuple[FlyStep, ...] = ()


@dataclass(frozen=True, slots=True)
class Standing:
    """A drone between two steps; a simulated drone learns its place from it."""

    position: Position
    soc: float
    load_kg: float


@dataclass(frozen=True, slots=True)
class Elsewhere:
    """The place of a drone that did not reach the end of its step; without station it is down."""

    station_id: StationId | None
    position: Position


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a step ended; `code` says why it did not end as planned.

    `elsewhere` is where the drone is when that is not the end of the step.
    """

    ended_at: datetime
    soc: float
    energy_j: float
    code: str | None = None
    has_failed: bool = False
    elsewhere: Elsewhere | None = None


@dataclass(frozen=True, slots=True)
class Sample:
    """The progress of a step; `power_w` is the power that the flight draws."""

    position: Position
    soc: float
    power_w: float
    speed_mps: float


class Vehicle(Protocol):
    """A drone, real or simulated, as the agent uses it."""

    @property
    def model(self) -> DroneModel:
        """The type of drone."""
        ...

    async def perform(self, run: StepRun) -> Outcome:
        """Do the step and return at its end; a call with the same run continues the step.

        The call is cancelled when an instruction changes or cuts the step.
        """
        ...

    def cut(self, run: StepRun, at: datetime) -> Outcome:
        """End a step on the ground at this moment, or earlier if it ended by itself."""
        ...

    def sample(self, run: StepRun, at: datetime) -> Sample:
        """The progress of the step at this moment."""
        ...

    def read(self, doing: StepRun | Standing, at: datetime) -> Reading:
        """What the sensors show at this moment."""
        ...

    async def land(self, run: StepRun) -> Outcome:
        """End a flight on the spot, and return once the drone is down."""
        ...

    def recall(self, run: StepRun) -> bool | None:
        """Whether a hand-over that began before a restart was done; None if that is unknown."""
        ...
