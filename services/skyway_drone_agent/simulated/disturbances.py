"""What differs from the plan for simulated drones; by default nothing does.

These are the keys of a scenario file, with their limits; docs/scenarios.md explains them. Some
scenarios come with Skyway. Chance is repeatable: the same question always has the same answer.
"""

import math
import tomllib
from collections.abc import Mapping
from hashlib import blake2b
from pathlib import Path
from struct import unpack
from typing import Annotated, Any, Final, Literal, Self

from pydantic import Field, ValidationError, model_validator

from skyway.bounds import Moment
from skyway.complaints import fault_of
from skyway.errors import InvalidInput
from skyway.ids import DroneId, StationId
from skyway.json_model import JsonModel

Factor = Annotated[float, Field(gt=0.0, le=100.0)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Seconds = Annotated[float, Field(ge=0.0, le=1e6)]

#: Numbers in one answer: a hash of 64 bytes holds 8 numbers of 8 bytes.
NUMBERS: Final = 8


class Wind(JsonModel):
    """A mean wind with gusts: a field over place and time, the same for all drones.

    `gust_mps` is the standard deviation of each of the wind's two components. Gusts that are
    `gust_span_m` or `gust_span_s` apart are nearly independent.
    """

    mean_mps: Annotated[float, Field(ge=0.0, le=40.0)] = 0.0
    from_deg: Annotated[float, Field(ge=0.0, le=360.0)] = 0.0
    gust_mps: Annotated[float, Field(ge=0.0, le=20.0)] = 0.0
    gust_span_m: Annotated[float, Field(ge=10.0, le=1e6)] = 3_000.0
    gust_span_s: Annotated[float, Field(ge=1.0, le=1e6)] = 600.0

    @property
    def blows(self) -> bool:
        """Whether there is any wind."""
        return self.mean_mps > 0.0 or self.gust_mps > 0.0


class Battery(JsonModel):
    """Worn batteries of a share of the drones, and the temperature of all."""

    temperature_c: Annotated[float, Field(ge=-40.0, le=90.0)] = 25.0
    worn_share: Share = 0.0
    capacity: Annotated[float, Field(ge=0.3, le=1.0)] = 1.0
    resistance_factor: Annotated[float, Field(ge=1.0, le=10.0)] = 1.0
    cell_spread_v: Annotated[float, Field(ge=0.0, le=0.5)] = 0.0


class Sensors(JsonModel):
    """Standard deviations of the sensors' errors; `current_share` is a gain error per drone."""

    gps_m: Annotated[float, Field(ge=0.0, le=100.0)] = 0.0
    air_speed_mps: Annotated[float, Field(ge=0.0, le=10.0)] = 0.0
    voltage_v: Annotated[float, Field(ge=0.0, le=2.0)] = 0.0
    current_share: Annotated[float, Field(ge=0.0, le=0.2)] = 0.0
    temperature_c: Annotated[float, Field(ge=0.0, le=10.0)] = 0.0

    @property
    def err(self) -> bool:
        """Whether any sensor has an error that changes with time."""
        return any((self.gps_m, self.air_speed_mps, self.voltage_v, self.temperature_c))


class TakenPad(JsonModel):
    """A pad that is occupied for a while; without `pad`, all pads of the station."""

    station_id: StationId
    pad: Annotated[int, Field(ge=0)] | None = None
    from_at: Moment
    until_at: Moment

    @model_validator(mode="after")
    def _ends_after_it_begins(self) -> Self:
        if self.until_at <= self.from_at:
            raise ValueError(f"until_at {self.until_at} does not lie after from_at {self.from_at}")
        return self


class Pads(JsonModel):
    """Pads that are occupied: each for a share of the time, `taken_s` each time; and named pads."""

    taken_share: Annotated[float, Field(ge=0.0, le=0.9)] = 0.0
    taken_s: Annotated[float, Field(ge=1.0, le=1e6)] = 900.0
    taken: tuple[TakenPad, ...] = ()


class FlightFault(JsonModel):
    """A fault in a share of the flights of some or all drones, `after_s` after take-off."""

    share: Share = 0.0
    after_s: Seconds = 60.0
    drone_ids: frozenset[DroneId] | None = None


class GpsLoss(FlightFault):
    """The GPS shows no position for `for_s`."""

    for_s: Seconds = 120.0


class MotorFailure(FlightFault):
    """A motor stops: the drone draws `power_factor` times the power until it is down."""

    power_factor: Annotated[float, Field(ge=1.0, le=5.0)] = 1.3


class Drift(FlightFault):
    """The drone drifts to the right of its track: most in the middle of the remaining way."""

    most_m: Annotated[float, Field(ge=0.0, le=10_000.0)] = 300.0


class LinkLoss(JsonModel):
    """In a share of all spans of `every_s`, the link is down once for `for_s`.

    `seconds` says whether these are seconds of wall time or of fleet time.
    """

    share: Share = 0.0
    every_s: Annotated[float, Field(ge=1.0, le=1e6)] = 600.0
    for_s: Annotated[float, Field(gt=0.0, le=1e6)] = 30.0
    seconds: Literal["wall", "fleet"] = "wall"
    drone_ids: frozenset[DroneId] | None = None

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.for_s >= self.every_s:
            raise ValueError(f"for_s {self.for_s:g} is not below every_s {self.every_s:g}")
        return self


class Disturbances(JsonModel):
    """Factors on the drone model's values, weather, and faults.

    The flight factors apply to the way, not to a landing. `power_noise` is the standard deviation
    of a flight's power as a share of the model's. Half of the variance is the same for all flights
    of a drone. All chance depends only on `seed`, the drone and the case.
    """

    title: str = ""
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    flight_time_factor: Factor = 1.0
    flight_energy_factor: Factor = 1.0
    charge_time_factor: Factor = 1.0
    power_noise: Annotated[float, Field(ge=0.0, le=0.5)] = 0.0
    absent_station_ids: frozenset[StationId] = frozenset()
    absent_share: Share = 0.0
    wind: Wind = Wind()
    battery: Battery = Battery()
    sensors: Sensors = Sensors()
    pads: Pads = Pads()
    gps: GpsLoss = GpsLoss()
    motor: MotorFailure = MotorFailure()
    drift: Drift = Drift()
    link: LinkLoss = LinkLoss()


#: Everything follows the drone model.
UNDISTURBED = Disturbances()

_BUNDLED: Final = Path(__file__).parent / "scenarios"


def scenario_names() -> tuple[str, ...]:
    """The scenarios that come with Skyway."""
    return tuple(sorted(path.stem for path in _BUNDLED.glob("*.toml")))


def read_scenario(name_or_file: str) -> Disturbances:
    """The disturbances of a bundled scenario by its name, or of a file.

    Raises
    ------
    InvalidInput
        There is no such scenario, or the file breaks a limit: key, value and limit are named.
    """
    is_bundled = name_or_file in scenario_names()
    path = _BUNDLED / f"{name_or_file}.toml" if is_bundled else Path(name_or_file)
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError as error:
        names = ", ".join(scenario_names())
        detail = f"{name_or_file} is neither a file nor one of {names}"
        raise InvalidInput("scenario", detail) from error
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InvalidInput("scenario", f"{path} cannot be read: {error}") from error
    return _checked(content, source=f"{path.name}: ")


def changed(scenario: Disturbances, changes: Mapping[str, Any]) -> Disturbances:
    """The scenario with other values of some keys; the values are checked like a file's."""
    return _checked(scenario.model_dump(exclude_unset=True) | dict(changes), source="")


def _checked(content: Mapping[str, Any], *, source: str) -> Disturbances:  # values as TOML has them
    try:
        return Disturbances.model_validate(content)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key, detail = fault_of(first)
        if first["type"] != "extra_forbidden":
            detail = f"{detail}, not {first['input']!r}"
        raise InvalidInput(f"{source}{key or 'scenario'}", detail) from error


def uniforms(seed: int, *about: object) -> tuple[float, ...]:
    """Uniform numbers in (0, 1) that depend only on the seed and the question."""
    question = "\x1f".join((str(seed), *map(str, about)))
    integers = unpack(f"<{NUMBERS}Q", blake2b(question.encode(), digest_size=64).digest())
    return tuple((integer + 0.5) / 2.0**64 for integer in integers)


def normals(seed: int, *about: object) -> tuple[float, ...]:
    """Normal numbers with mean 0 and deviation 1, by the Box-Muller transform."""
    numbers: list[float] = []
    even = uniforms(seed, *about)
    for radius, turn in zip(even[::2], even[1::2], strict=True):
        length = math.sqrt(-2.0 * math.log(radius))
        numbers += (length * math.cos(math.tau * turn), length * math.sin(math.tau * turn))
    return tuple(numbers)


def happens(share: float, seed: int, *about: object) -> bool:
    """Whether an event that happens in this share of all cases happens in this case."""
    return share > 0.0 and uniforms(seed, *about)[0] < share
