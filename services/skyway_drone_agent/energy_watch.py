"""Consumption against plan: what the flights of a mission use, and what the model says of them."""

import math
from datetime import datetime
from typing import Final

from skyway.ids import MissionId
from skyway_drone_agent.leg import Leg
from skyway_drone_agent.reading import Reading
from skyway_drone_agent.wind_triangle import Velocity, ground_speed_mps

#: Seconds of flight over which the two are compared.
_SMOOTHED_OVER_S: Final = 180.0

#: A mission begins with the belief of so many seconds of flight.
_BELIEF_S: Final = 30.0

#: Beyond these factors something else is wrong.
_LEAST, _MOST = 0.5, 4.0


class EnergyWatch:
    """Used against planned energy, over the ground and as it would be without wind.

    Only the way counts: between two readings on the same leg, before its landing.
    """

    __slots__ = ("_belief_j", "_mark", "_mission_id", "_planned_j", "_still_j", "_used_j")

    def __init__(self, *, power_w: float) -> None:
        self._belief_j = power_w * _BELIEF_S
        self._used_j = self._planned_j = self._still_j = self._belief_j
        self._mission_id: MissionId | None = None
        self._mark: tuple[Leg, float, float, datetime] | None = None

    @property
    def factor(self) -> float:
        """What the flights of this mission use, against what the model says."""
        return _bounded(self._used_j / self._planned_j)

    @property
    def still_air_factor(self) -> float:
        """The same against what the model says of flights in this wind."""
        return _bounded(self._used_j / self._still_j)

    def begin(self, mission_id: MissionId) -> None:
        """Compare anew; the belief is what the mission before showed, but for its wind."""
        if mission_id == self._mission_id:
            return
        self._mission_id = mission_id
        self._used_j = self._belief_j * self.still_air_factor
        self._planned_j = self._still_j = self._belief_j
        self._mark = None

    def take(self, reading: Reading, leg: Leg | None, *, wind_mps: Velocity | None) -> None:
        """Compare since the reading before; without a leg nothing is flown."""
        before, self._mark = self._mark, None
        if leg is None or not reading.has_gps or not leg.is_on_the_way(reading):
            return
        share_left = leg.share_left(reading.position)
        self._mark = (leg, share_left, reading.consumed_j, reading.at)
        if before is None or before[0] is not leg:
            return
        flown_j = (before[1] - share_left) * leg.flight_j
        slower = 1.0
        if wind_mps is not None:
            slower = leg.speed_mps / ground_speed_mps(leg.speed_mps, leg.bearing_rad, wind_mps)
        kept = math.exp(-(reading.at - before[3]).total_seconds() / _SMOOTHED_OVER_S)
        self._used_j = self._used_j * kept + reading.consumed_j - before[2]
        self._planned_j = self._planned_j * kept + flown_j
        self._still_j = self._still_j * kept + flown_j * slower


def _bounded(factor: float) -> float:
    return min(_MOST, max(_LEAST, factor))
