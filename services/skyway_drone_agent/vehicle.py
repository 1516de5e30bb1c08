"""The drone as the agent sees it: its steps, sensors, battery, and the interface of a vehicle."""

from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from itertools import pairwise
from typing import Final, Protocol

from skyway.contracts.flight_step import DeliverStep, FlightStep, FlyStep
from skyway.drone.model import DroneModel
from skyway.geo import Position
from skyway.ids import PackageId, StationId

#: Flights, each with the mass of what is on board, in kilograms.
LoadedFlights = Sequence[tuple[FlyStep, float]]

#: The energy that the drone uses for flights in the wind that it feels, as a multiple of its
#: model's energy. Without flights, what it uses in still air.
EnergyUse = Callable[[LoadedFlights], float]

#: Open-circuit voltage of a lithium-polymer cell by state of charge: a rounded discharge curve at
#: 25 degrees C, strictly rising.
_LIPO_CURVE: Final = (
    (0.00, 3.27),
    (0.05, 3.61),
    (0.10, 3.69),
    (0.20, 3.73),
    (0.30, 3.77),
    (0.40, 3.80),
    (0.50, 3.84),
    (0.60, 3.87),
    (0.70, 3.95),
    (0.80, 4.02),
    (0.90, 4.11),
    (1.00, 4.20),
)


@dataclass(frozen=True, slots=True)
class Reading:
    """What the sensors show at a moment of fleet time; without GPS the position is the last one.

    `consumed_j` counts the energy that left the battery since the vehicle was switched on. Charging
    counts backwards. `current_a` is negative while charging. Speeds are vectors, east and north:
    over ground, and through the air. `load_kg` is the mass on board, None without such a sensor.
    A battery that reports nothing has its last voltage. `cells` are in series.
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
    has_battery: bool = True
    motors_work: bool = True
    pad_is_free: bool = True
    cells: int = 6

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


def wait_ends_at(run: StepRun) -> datetime | None:
    """When a hand-over that waits for proofs is given up; None if it waits for none."""
    if not isinstance(run.step, DeliverStep) or not run.step.verification:
        return None
    return run.started_at + timedelta(seconds=run.step.recipient_wait_s)


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

    `elsewhere` is where the drone is when that is not the end of the step. `handed_ids` are the
    packages that a failed hand-over has handed over all the same.
    """

    ended_at: datetime
    soc: float
    energy_j: float
    code: str | None = None
    has_failed: bool = False
    elsewhere: Elsewhere | None = None
    handed_ids: tuple[PackageId, ...] = ()


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

    async def photograph(self) -> bytes | None:
        """A picture of the hand-over as JPEG; None without a camera."""
        ...


@dataclass(frozen=True, slots=True)
class BatteryPack:
    """Cells in series; `resistance_ohm` is that of the whole pack.

    Keep one instance: it computes the columns of its curve when it is made.
    """

    cells: int = 6
    resistance_ohm: float = 0.02
    curve: tuple[tuple[float, float], ...] = _LIPO_CURVE
    _socs: tuple[float, ...] = field(init=False, repr=False, compare=False)
    _volts: tuple[float, ...] = field(init=False, repr=False, compare=False)
    _slopes: tuple[float, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        socs = tuple(soc for soc, _ in self.curve)
        volts = tuple(self.cells * cell_v for _, cell_v in self.curve)
        rises = zip(pairwise(socs), pairwise(volts), strict=True)
        object.__setattr__(self, "_socs", socs)
        object.__setattr__(self, "_volts", volts)
        object.__setattr__(
            self, "_slopes", tuple((v_1 - v_0) / (s_1 - s_0) for (s_0, s_1), (v_0, v_1) in rises)
        )

    def open_voltage_v(self, soc: float) -> float:
        """The pack's voltage without a load."""
        return _along(self._socs, self._volts, soc)

    def soc_at_rest(self, open_voltage_v: float) -> float:
        """The charge that shows this voltage without a load, from 0 to 1."""
        return _along(self._volts, self._socs, open_voltage_v)

    def volts_per_soc(self, soc: float) -> float:
        """The slope of the pack's curve: in the flat middle a voltage says little."""
        after = bisect_right(self._socs, soc, 1, len(self._socs) - 1)
        return self._slopes[after - 1]

    def current_a(self, soc: float, power_w: float) -> float:
        """The current that gives this power; negative while charging.

        The lesser solution of power = (open voltage - resistance * current) * current.
        """
        open_v = self.open_voltage_v(soc)
        most_w = open_v * open_v / (4 * self.resistance_ohm)
        root = (open_v * open_v - 4 * self.resistance_ohm * min(power_w, most_w)) ** 0.5
        return float((open_v - root) / (2 * self.resistance_ohm))


def _along(xs: Sequence[float], ys: Sequence[float], x: float) -> float:
    """Straight between the points of a rising curve, flat beyond its ends."""
    if x <= xs[0]:
        return ys[0]
    if x >= xs[-1]:
        return ys[-1]
    after = bisect_right(xs, x)
    x_0, y_0 = xs[after - 1], ys[after - 1]
    return y_0 + (ys[after] - y_0) * (x - x_0) / (xs[after] - x_0)
