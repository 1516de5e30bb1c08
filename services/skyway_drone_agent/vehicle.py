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


@dataclass(frozen=True, slots=True)
class StepRun:
    """A step that has begun, with what the drone had then.

    `changed_at` is when an instruction last changed the step under way: it ends no earlier.
    `onward` are the flights that follow a flight which does not land, up to the landing.
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
    """A drone between two steps; a simulated one knows only so where it is."""

    position: Position
    soc: float
    load_kg: float


@dataclass(frozen=True, slots=True)
class Elsewhere:
    """Where a drone is that has not come to its step's end; without a station it is down."""

    station_id: StationId | None
    position: Position


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a step ended; `code` when it ended otherwise than asked, or did not come about.

    `elsewhere` is where the drone is after a step that failed or was broken off, if known better
    than by where the step leads.
    """

    ended_at: datetime
    soc: float
    energy_j: float
    code: str | None = None
    has_failed: bool = False
    elsewhere: Elsewhere | None = None


@dataclass(frozen=True, slots=True)
class Sample:
    """What the drone's sensors show; `power_w` is what the flight draws."""

    position: Position
    soc: float
    power_w: float
    speed_mps: float


class Vehicle(Protocol):
    """What the agent needs of a drone, flown for real or simulated."""

    @property
    def model(self) -> DroneModel:
        """The type of drone."""
        ...

    async def perform(self, run: StepRun) -> Outcome:
        """Do the step and return at its end; the same run again goes on with it.

        Cancelled when an instruction changes the step or cuts it short.
        """
        ...

    def cut(self, run: StepRun, at: datetime) -> Outcome:
        """End a step on the ground at this moment, or when it ended by itself before."""
        ...

    def sample(self, run: StepRun, at: datetime) -> Sample:
        """How far the step has come at this moment."""
        ...

    def read(self, doing: StepRun | Standing, at: datetime) -> Reading:
        """What the sensors show at this moment."""
        ...

    async def land(self, run: StepRun) -> Outcome:
        """End a flight here and now, wherever that is, and return once the drone is down."""
        ...

    def recall(self, run: StepRun) -> bool | None:
        """Whether a hand-over that had begun before a restart was done; None: it cannot know."""
        ...
