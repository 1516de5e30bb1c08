"""Energy use against plan: what flights use, compared with the drone model."""

import math
from datetime import datetime
from typing import Final

from skyway.ids import MissionId
from skyway_drone_agent.analysis.leg import Leg
from skyway_drone_agent.analysis.wind import Velocity, ground_speed_mps
from skyway_drone_agent.vehicle import Reading

#: Seconds of flight over which the comparison is smoothed.
_SMOOTHED_OVER_S: Final = 180.0

#: A mission starts with the earlier factor, which counts as so many seconds of flight.
_BELIEF_S: Final = 30.0

#: Seconds on the ground over which the last flights are forgotten. Else a drone with a high factor
#: would never take off, and would never learn that the factor is too high.
_FORGOTTEN_OVER_S: Final = 4 * 3_600.0

#: Limits of the factor; beyond them something else is wrong.
_LEAST, _MOST = 0.5, 4.0


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
        return 1.0 + (factor - 1.0) * math.exp(-max(0.0, stood_s) / _FORGOTTEN_OVER_S)

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
        kept = math.exp(-since_s / _SMOOTHED_OVER_S)
        self._used_j = self._used_j * kept + reading.consumed_j - before[2]
        self._planned_j = self._planned_j * kept + planned_j
