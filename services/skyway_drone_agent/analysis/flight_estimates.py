"""What flights show: the wind, from the two speeds of a drone, and the energy used against plan."""

import math
from datetime import datetime
from typing import Final

from skyway.ids import MissionId
from skyway_drone_agent.analysis.leg import Leg
from skyway_drone_agent.vehicle import Reading

#: Least ground speed as a share of the air speed, for a drone that the wind stops or pushes back.
#: So energies stay finite, and ten times the energy is out of reach anyway.
_LEAST_SHARE: Final = 0.1

#: East and north, metres per second.
Velocity = tuple[float, float]

#: Seconds over which gusts are smoothed, for the wind of the moment: a kilometre or so of flight.
GUSTS_SMOOTHED_OVER_S: Final = 45.0

#: The same for the wind on the flights ahead. A gust is over after a few minutes, so it must not
#: count for the next half hour.
AHEAD_SMOOTHED_OVER_S: Final = 240.0

#: A slower drone hovers, climbs or stands: its speeds say little about the wind on the way.
_LEAST_AIR_SPEED_MPS: Final = 3.0

#: Seconds after which an estimate is forgotten: the wind may have turned.
_WIND_FORGOTTEN_AFTER_S: Final = 1_800.0

#: Seconds of flight over which the comparison of energies is smoothed.
_USE_SMOOTHED_OVER_S: Final = 180.0

#: A mission starts with the earlier factor, which counts as so many seconds of flight.
_BELIEF_S: Final = 30.0

#: Seconds on the ground over which the last flights are forgotten. Else a drone with a high factor
#: would never take off, and would never learn that the factor is too high.
_USE_FORGOTTEN_OVER_S: Final = 4 * 3_600.0

#: Limits of the factor of energy use; beyond them something else is wrong.
_LEAST, _MOST = 0.5, 4.0


def ground_speed_mps(air_speed_mps: float, bearing_rad: float, wind_mps: Velocity) -> float:
    """Ground speed along a track of this bearing; `wind_mps` is where the air moves."""
    sine, cosine = math.sin(bearing_rad), math.cos(bearing_rad)
    along = wind_mps[0] * sine + wind_mps[1] * cosine
    across = wind_mps[0] * cosine - wind_mps[1] * sine
    held = air_speed_mps * air_speed_mps - across * across
    least = _LEAST_SHARE * air_speed_mps
    return max(least, along + math.sqrt(held)) if held > 0.0 else least


class WindEstimate:
    """The wind, smoothed over so many seconds; only readings in flight count."""

    __slots__ = ("_felt_at", "_smoothed_over_s", "_weight_s", "_wind_mps")

    def __init__(self, *, smoothed_over_s: float) -> None:
        self._smoothed_over_s = smoothed_over_s
        self._wind_mps: Velocity = (0.0, 0.0)
        self._weight_s = 0.0
        self._felt_at: datetime | None = None

    def update(self, reading: Reading, *, is_flying: bool) -> Velocity | None:
        """The wind after this reading; None without an estimate."""
        since_s = self._since_s(reading.at)
        if since_s > _WIND_FORGOTTEN_AFTER_S:
            self._felt_at, self._weight_s = None, 0.0
        air_speed_mps = math.hypot(*reading.air_mps)
        if is_flying and reading.has_gps and air_speed_mps >= _LEAST_AIR_SPEED_MPS:
            self._feel(reading, since_s=since_s)
        return None if self._felt_at is None else self._wind_mps

    def _feel(self, reading: Reading, *, since_s: float) -> None:
        """Add a reading: first a plain mean, then the last ones count most."""
        kept = math.exp(-since_s / self._smoothed_over_s) if self._weight_s else 0.0
        new_s = self._smoothed_over_s * (1.0 - kept) if self._weight_s else 1.0
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


class EnergyUseMonitor:
    """Compares used energy with the model's energy for the same flights in the same wind.

    Only the way counts: between two readings on the same leg, before its landing.
    """

    __slots__ = ("_belief_j", "_flown_at", "_mark", "_mission_id", "_planned_j", "_used_j")

    def __init__(self, *, power_w: float) -> None:
        self._belief_j = power_w * _BELIEF_S
        self._used_j = self._planned_j = self._belief_j
        self._mission_id: MissionId | None = None
        self._mark: tuple[Leg, float, float] | None = None
        self._flown_at: datetime | None = None

    def factor(self, at: datetime) -> float:
        """Used energy by planned energy, of this mission's flights or of the last ones."""
        # A drone that is blown back makes no progress on its plan.
        factor = min(_MOST, max(_LEAST, self._used_j / max(self._planned_j, 1.0)))
        if self._flown_at is None:
            return factor
        stood_s = (at - self._flown_at).total_seconds()
        return 1.0 + (factor - 1.0) * math.exp(-max(0.0, stood_s) / _USE_FORGOTTEN_OVER_S)

    @property
    def measured(self) -> float | None:
        """The factor of the last flights as it was when they ended; None before a flight."""
        return None if self._flown_at is None else self.factor(self._flown_at)

    def begin(self, mission_id: MissionId, at: datetime) -> None:
        """Start the comparison for a new mission, with the factor of the mission before."""
        if mission_id == self._mission_id:
            return
        self._used_j = self._belief_j * self.factor(at)
        self._planned_j = self._belief_j
        self._mission_id, self._mark, self._flown_at = mission_id, None, at

    def update(self, reading: Reading, leg: Leg | None, *, wind_mps: Velocity | None) -> None:
        """Compare since the last reading; without a leg the drone does not fly."""
        before, self._mark = self._mark, None
        if leg is None or not reading.has_gps or not leg.is_on_the_way(reading):
            return
        share_left = leg.share_left(reading.position)
        self._mark = (leg, share_left, reading.consumed_j)
        since_s = (reading.at - (self._flown_at or reading.at)).total_seconds()
        self._flown_at = reading.at
        if before is None or before[0] is not leg:
            return
        planned_j = (before[1] - share_left) * leg.flight_j
        if wind_mps is not None:
            against_mps = ground_speed_mps(leg.speed_mps, leg.bearing_rad, wind_mps)
            planned_j *= leg.speed_mps / against_mps
        kept = math.exp(-since_s / _USE_SMOOTHED_OVER_S)
        self._used_j = self._used_j * kept + reading.consumed_j - before[2]
        self._planned_j = self._planned_j * kept + planned_j
