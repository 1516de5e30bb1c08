"""The wind at a place and a moment: a mean wind, and gusts that change smoothly."""

import math
from dataclasses import dataclass
from datetime import datetime
from functools import lru_cache
from typing import Final

from skyway.geo import EARTH_RADIUS_M, Position, unit_vector
from skyway_drone_agent.simulated.disturbances import Wind, normals, uniforms

#: Waves in the gusts of one component; the sum of this many is nearly normal.
_WAVES: Final = 8


@dataclass(frozen=True, slots=True)
class _Wave:
    """A wave through space (radians per unit of the Earth's radius) and time (radians per s)."""

    east: float
    north: float
    up: float
    per_s: float
    phase: float


@dataclass(frozen=True, slots=True)
class WindField:
    """The velocity of the air as a field, east and north.

    Notes
    -----
    Random Fourier features (Rahimi and Recht 2007): waves with normally distributed wave numbers
    sum up to a field whose correlation falls as exp(-d²/2) in spans of place and time.
    """

    mean_mps: tuple[float, float]
    amplitude_mps: float
    waves: tuple[tuple[_Wave, ...], tuple[_Wave, ...]]

    def at(self, position: Position, moment: datetime) -> tuple[float, float]:
        """The velocity of the air, metres per second."""
        if self.amplitude_mps == 0.0:
            return self.mean_mps
        x, y, z = unit_vector(position)
        at_s = moment.timestamp()
        east, north = (
            mean
            + self.amplitude_mps
            * sum(
                math.cos(
                    wave.east * x + wave.north * y + wave.up * z + wave.per_s * at_s + wave.phase
                )
                for wave in waves
            )
            for mean, waves in zip(self.mean_mps, self.waves, strict=True)
        )
        return east, north


@lru_cache(maxsize=8)
def wind_field(wind: Wind, seed: int) -> WindField:
    """The field of this wind and seed."""
    towards_rad = math.radians(wind.from_deg) + math.pi
    return WindField(
        mean_mps=(
            wind.mean_mps * math.sin(towards_rad),
            wind.mean_mps * math.cos(towards_rad),
        ),
        amplitude_mps=wind.gust_mps * math.sqrt(2.0 / _WAVES),
        waves=(
            tuple(_wave(wind, seed, "east", count) for count in range(_WAVES)),
            tuple(_wave(wind, seed, "north", count) for count in range(_WAVES)),
        ),
    )


def _wave(wind: Wind, seed: int, component: str, count: int) -> _Wave:
    space = EARTH_RADIUS_M / wind.gust_span_m
    numbers = normals(seed, "wind", component, count)
    return _Wave(
        east=numbers[0] * space,
        north=numbers[1] * space,
        up=numbers[2] * space,
        per_s=numbers[3] / wind.gust_span_s,
        phase=math.tau * uniforms(seed, "wind phase", component, count)[0],
    )
