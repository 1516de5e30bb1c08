"""What a flight meets that its plan did not know: power noise, wind, pads that free up late."""

import math
from dataclasses import dataclass
from random import Random
from typing import Self

from skyway.geo import Position, bearing_rad
from skyway.units import minutes_to_s

#: The slowest ground speed, as a share of the air speed, that a head wind leaves. Our own choice.
_SLOWEST_SHARE = 0.2


@dataclass(frozen=True, slots=True)
class Climate:
    """How strong the disturbances are; all three are our own choice.

    `power_noise` is the standard deviation of a segment's power as a share of the model's, half of
    it the same for the whole flight; `wind_mps` the mean wind; `late_share` the share of sessions
    whose pad is still held when they should begin, for `late_s` on average.
    """

    power_noise: float = 0.0
    wind_mps: float = 0.0
    late_share: float = 0.0
    late_s: float = minutes_to_s(10)


@dataclass(slots=True)
class Day:
    """One flight's chance: a constant wind, the drone's own energy use, and noise on the way."""

    climate: Climate
    random: Random
    wind_mps: float
    wind_to_rad: float
    energy_use: float

    @classmethod
    def of(cls, climate: Climate, random: Random) -> Self:
        """The day that this chance draws; wind speeds follow Rayleigh's distribution."""
        scale = climate.wind_mps / math.sqrt(math.pi / 2)
        noise = climate.power_noise / math.sqrt(2)
        return cls(
            climate,
            random,
            wind_mps=scale * math.sqrt(-2 * math.log(1 - random.random())),
            wind_to_rad=random.uniform(0, 2 * math.pi),
            energy_use=random.gauss(1.0, noise),
        )

    def slowness(self, start: Position, end: Position, *, air_speed_mps: float) -> float:
        """How many times longer the segment takes in this wind; the drone holds its track."""
        turn = self.wind_to_rad - bearing_rad(start, end)
        along_mps = self.wind_mps * math.cos(turn)
        across_mps = self.wind_mps * math.sin(turn)
        still_mps = math.sqrt(max(0.0, air_speed_mps**2 - across_mps**2))
        ground_mps = max(_SLOWEST_SHARE * air_speed_mps, still_mps + along_mps)
        return air_speed_mps / ground_mps

    def power_factor(self) -> float:
        """How many times the model's power this segment takes."""
        noise = self.climate.power_noise / math.sqrt(2)
        return max(0.0, self.energy_use + self.random.gauss(0.0, noise))

    def pad_delay_s(self) -> float:
        """How long the pad is still held when the session should begin."""
        if self.random.random() >= self.climate.late_share:
            return 0.0
        return self.random.expovariate(1 / self.climate.late_s)
