"""What is seen at one look at a running Skyway."""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Alarm:
    """An alarm that nobody has acknowledged; `about` is a drone, mission or station."""

    at: str
    level: str
    code: str
    about: str
    detail: str


@dataclass(frozen=True, slots=True)
class Picture:
    """Counts by state, and how well the talk with drones goes; rates are None at the first look."""

    url: str
    at: str
    drones: Mapping[str, int]
    missions: Mapping[str, int]
    deliveries: Mapping[str, int]
    alarms: tuple[Alarm, ...]
    lag_mean_s: float | None
    lag_max_s: float | None
    states_per_s: float | None
    samples_per_s: float | None
    recompositions: int
    unsent: Mapping[str, int]


@dataclass(frozen=True, slots=True)
class Said:
    """How many messages drones had sent at a moment of the machine's monotonic clock."""

    at_s: float
    states: int
    samples: int

    def states_since(self, earlier: "Said") -> float:
        """States a second; an agent that begins anew counts from 1, which is no step back."""
        return max(0, self.states - earlier.states) / (self.at_s - earlier.at_s)

    def samples_since(self, earlier: "Said") -> float:
        """Samples a second."""
        return max(0, self.samples - earlier.samples) / (self.at_s - earlier.at_s)
