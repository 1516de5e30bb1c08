"""Reach: how far the charge takes the drone.

It depends on the wind and on the consumption so far.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from heapq import nsmallest
from operator import itemgetter
from typing import Final

from skyway.drone.flight import flight_power_w, speed_mps
from skyway.drone.model import DroneModel
from skyway.geo import Position, bearing_rad, distance_m
from skyway.ids import StationId
from skyway_drone_agent.analysis.flight_estimates import Velocity, ground_speed_mps
from skyway_drone_agent.analysis.landings import Landing
from skyway_drone_agent.analysis.leg import Leg
from skyway_drone_agent.vehicle import Reading

#: Number of landings that are judged, the nearest first.
_JUDGED: Final = 8

#: Share of the reserve that must be left after a safe landing.
_LEAST_OF_RESERVE: Final = 0.2

#: A safe landing keeps this many standard deviations of the charge as margin, but at most half the
#: reserve: a plan that lands with the whole reserve must count as safe.
_DEVIATIONS, _MOST_OF_RESERVE = 2.0, 0.5

#: Rounding, as a share of the battery.
_ROUNDING: Final = 1e-9

_CALM_MPS: Final = (0.0, 0.0)


@dataclass(frozen=True, slots=True)
class LandingInReach:
    """A station, and the expected charge after landing there.

    The landing `is_safe` if the drone also reaches it with less charge than estimated.
    """

    station_id: StationId
    position: Position
    distance_m: float
    soc_at_landing: float
    is_safe: bool


@dataclass(frozen=True, slots=True)
class NextLanding:
    """The end of the released flights; `need_j` is the energy to land there."""

    station_id: StationId
    need_j: float
    soc_at_landing: float


@dataclass(frozen=True, slots=True)
class Reach:
    """The energy of flights with this battery in this wind.

    Energies are the model's: for a worn battery, flights count as if they took more energy.
    `still_air_factor` is the used energy by the model's energy, without the effect of wind.
    """

    model: DroneModel
    soc: float
    soc_error: float
    state_of_health: float
    still_air_factor: float
    wind_mps: Velocity

    def need_j(self, legs: Sequence[Leg], *, share_left: float = 1.0) -> float:
        """Energy of these flights with their landings; `share_left` is of the first flight."""
        flights_j = landings_j = 0.0
        for leg in legs:
            flights_j += share_left * leg.flight_j * self._slower(leg.speed_mps, leg.bearing_rad)
            landings_j += leg.stop_j
            share_left = 1.0
        return (flights_j * self.still_air_factor + landings_j) / self.state_of_health

    def soc_after(self, need_j: float) -> float:
        """The charge after this energy is used; below 0 if it does not suffice."""
        return self.soc - need_j / self.model.battery_j

    def factor_over(self, legs: Sequence[Leg]) -> float:
        """Energy of these flights by the model's energy, without their landings.

        Without flights it is the factor in still air.
        """
        if not legs:
            return self.still_air_factor / self.state_of_health
        planned_j = sum(leg.flight_j for leg in legs)
        taken_j = sum(leg.flight_j * self._slower(leg.speed_mps, leg.bearing_rad) for leg in legs)
        return taken_j / planned_j * self.still_air_factor / self.state_of_health

    def range_m(self, load_kg: float) -> float:
        """Range above the reserve, with a landing, against the wind."""
        speed = speed_mps(self.model, load_kg)
        east, north = self.wind_mps
        blowing_mps = (east * east + north * north) ** 0.5
        metre_j = self._metre_j(load_kg) * speed / ground_speed_mps(speed, 0.0, (0, -blowing_mps))
        spare_j = (self.soc - self.model.reserve_soc) * self.model.battery_j
        return max(0.0, spare_j - self.model.stop_j / self.state_of_health) / metre_j

    def landings_in_reach(
        self, landings: Iterable[Landing], *, position: Position, load_kg: float
    ) -> tuple[LandingInReach, ...]:
        """The landings that the drone can reach straight from here, nearest first."""
        speed, metre_j = speed_mps(self.model, load_kg), self._metre_j(load_kg)
        stop_j = self.model.stop_j / self.state_of_health
        safe_soc = self._safe_soc()
        in_reach = []
        far = ((distance_m(position, landing.position), landing) for landing in landings)
        for length_m, landing in nsmallest(_JUDGED, far, key=itemgetter(0)):
            flight_j = length_m * metre_j
            if self.wind_mps != _CALM_MPS:
                flight_j *= self._slower(speed, bearing_rad(position, landing.position))
            soc = self.soc_after(flight_j + stop_j)
            if soc >= -_ROUNDING:
                is_safe = soc >= safe_soc
                in_reach.append(
                    LandingInReach(landing.station_id, landing.position, length_m, soc, is_safe)
                )
        return tuple(sorted(in_reach, key=lambda one: one.distance_m))

    def _safe_soc(self) -> float:
        reserve = self.model.reserve_soc
        in_hand = min(_DEVIATIONS * self.soc_error, _MOST_OF_RESERVE * reserve)
        return _LEAST_OF_RESERVE * reserve + in_hand - _ROUNDING

    def _metre_j(self, load_kg: float) -> float:
        """Energy of one metre without wind."""
        planned = flight_power_w(self.model, load_kg) / speed_mps(self.model, load_kg)
        return planned * self.still_air_factor / self.state_of_health

    def _slower(self, speed: float, bearing: float) -> float:
        if self.wind_mps == _CALM_MPS:
            return 1.0
        return speed / ground_speed_mps(speed, bearing, self.wind_mps)


class EnergyToLand:
    """Estimates the energy to land; during the landing it subtracts what was used."""

    __slots__ = ("_judged",)

    def __init__(self) -> None:
        self._judged: tuple[Leg, float, float] | None = None

    def need_j(
        self, reading: Reading, leg: Leg | None, flights: tuple[Leg, ...], *, reach: Reach
    ) -> float:
        """Energy for the leg under way, if any, and for the flights after it."""
        if leg is None:
            return reach.need_j(flights)
        judged = self._judged
        if judged is not None and judged[0] is leg and not leg.is_on_the_way(reading):
            used_j = (reading.consumed_j - judged[2]) / reach.state_of_health
            return max(0.0, judged[1] - used_j)
        need_j = reach.need_j(flights, share_left=leg.share_left(reading.position))
        self._judged = (leg, need_j, reading.consumed_j)
        return need_j
