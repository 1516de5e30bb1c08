"""The wind: estimated from the two speeds of a drone, and its effect on a flight."""

import math
from datetime import datetime
from typing import Final

from skyway_drone_agent.vehicle import Reading

#: Least ground speed as a share of the air speed, for a drone that the wind stops or pushes back.
#: So energies stay finite, and ten times the energy is out of reach anyway.
_LEAST_SHARE: Final = 0.1

#: East and north, metres per second.
Velocity = tuple[float, float]


def ground_speed_mps(air_speed_mps: float, bearing_rad: float, wind_mps: Velocity) -> float:
    """Ground speed along a track of this bearing; `wind_mps` is where the air moves."""
    sine, cosine = math.sin(bearing_rad), math.cos(bearing_rad)
    along = wind_mps[0] * sine + wind_mps[1] * cosine
    across = wind_mps[0] * cosine - wind_mps[1] * sine
    held = air_speed_mps * air_speed_mps - across * across
    least = _LEAST_SHARE * air_speed_mps
    return max(least, along + math.sqrt(held)) if held > 0.0 else least


#: Seconds over which gusts are smoothed: a kilometre or so of flight.
_SMOOTHED_OVER_S: Final = 45.0

#: A slower drone hovers, climbs or stands: its speeds say little about the wind on the way.
_LEAST_AIR_SPEED_MPS: Final = 3.0

#: Seconds after which an estimate is forgotten: the wind may have turned.
_FORGOTTEN_AFTER_S: Final = 1_800.0


class WindEstimate:
    """The smoothed wind; only readings in flight count."""

    __slots__ = ("_felt_at", "_weight_s", "_wind_mps")

    def __init__(self) -> None:
        self._wind_mps: Velocity = (0.0, 0.0)
        self._weight_s = 0.0
        self._felt_at: datetime | None = None

    def update(self, reading: Reading, *, is_flying: bool) -> Velocity | None:
        """The wind after this reading; None without an estimate."""
        since_s = self._since_s(reading.at)
        if since_s > _FORGOTTEN_AFTER_S:
            self._felt_at, self._weight_s = None, 0.0
        air_speed_mps = math.hypot(*reading.air_mps)
        if is_flying and reading.has_gps and air_speed_mps >= _LEAST_AIR_SPEED_MPS:
            self._feel(reading, since_s=since_s)
        return None if self._felt_at is None else self._wind_mps

    def _feel(self, reading: Reading, *, since_s: float) -> None:
        """Add a reading: first a plain mean, then the last minute counts most."""
        kept = math.exp(-since_s / _SMOOTHED_OVER_S) if self._weight_s else 0.0
        new_s = _SMOOTHED_OVER_S * (1.0 - kept) if self._weight_s else 1.0
        self._weight_s = self._weight_s * kept + new_s
        share = new_s / self._weight_s
        east, north = self._wind_mps
        self._wind_mps = (
            east + share * (reading.ground_mps[0] - reading.air_mps[0] - east),
            north + share * (reading.ground_mps[1] - reading.air_mps[1] - north),
        )
        self._felt_at = reading.at

    def _since_s(self, at: datetime) -> float:
        return 0.0 if self._felt_at is None else (at - self._felt_at).total_seconds()
