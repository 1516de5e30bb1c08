"""A flight by the drone model: its length, course, speed and energy."""

import math
from dataclasses import dataclass
from typing import Final

from skyway.contracts.flight_step import (
    DeliverStep,
    FlyStep,
    PackageOnBoard,
    PickUpStep,
    RechargeStep,
    ReturnStep,
)
from skyway.drone.flight import flight_energy_j, speed_mps
from skyway.drone.model import DroneModel
from skyway.geo import EARTH_RADIUS_M, Position, bearing_rad, distance_m
from skyway_drone_agent.journal.logbook import CurrentMission, Logbook
from skyway_drone_agent.vehicle import Reading

#: A drone lands if it is this near to its landing and slower over ground than this share of its
#: speed. Farther away a slow drone flies against the wind.
_LEAST_SPEED, _NEAR_M = 0.1, 100.0

#: Shares of the way below this are rounding.
_NO_WAY: Final = 1e-9


@dataclass(frozen=True, slots=True)
class Leg:
    """One FLY step with a load; `span_m` is the direct distance, `flight_j` is without landing."""

    step: FlyStep
    span_m: float
    bearing_rad: float
    speed_mps: float
    flight_j: float
    stop_j: float

    def share_left(self, position: Position) -> float:
        """The share of the way that is left, 1 at its beginning."""
        if self.span_m <= 0.0:
            return 0.0
        return distance_m(position, self.step.to_position) / self.span_m

    def is_on_the_way(self, reading: Reading) -> bool:
        """Whether the drone flies on the way and does not land yet."""
        left = self.share_left(reading.position)
        if left * self.span_m > _NEAR_M:
            return True
        return left > _NO_WAY and math.hypot(*reading.ground_mps) >= _LEAST_SPEED * self.speed_mps


def leg_of(step: FlyStep, *, model: DroneModel, load_kg: float) -> Leg:
    """The leg of this step."""
    return Leg(
        step=step,
        span_m=distance_m(step.from_position, step.to_position),
        bearing_rad=bearing_rad(step.from_position, step.to_position),
        speed_mps=speed_mps(model, load_kg),
        flight_j=flight_energy_j(model, length_m=step.length_m, load_kg=load_kg),
        stop_j=model.stop_j if step.lands else 0.0,
    )


def legs_ahead(
    mission: CurrentMission, *, packages: tuple[PackageOnBoard, ...], model: DroneModel
) -> tuple[Leg, ...]:
    """The next flights up to the next recharge, each with its load."""
    load = {package.package_id: package.mass_kg for package in packages}
    legs: list[Leg] = []
    for step in mission.steps:
        match step:
            case PickUpStep():
                load |= {package.package_id: package.mass_kg for package in step.packages}
            case DeliverStep() | ReturnStep():
                load = {key: mass for key, mass in load.items() if key not in step.package_ids}
            case FlyStep():
                legs.append(leg_of(step, model=model, load_kg=sum(load.values())))
            case RechargeStep() if legs:
                break
    return tuple(legs)


def off_course_m(leg: Leg, position: Position) -> float:
    """Distance from the great circle between the leg's ends, and from the ends beyond them."""
    start, end = leg.step.from_position, leg.step.to_position
    from_start = distance_m(start, position) / EARTH_RADIUS_M
    aside_rad = bearing_rad(start, position) - leg.bearing_rad
    if from_start == 0.0 or math.cos(aside_rad) < 0.0:
        return from_start * EARTH_RADIUS_M
    across = math.asin(math.sin(from_start) * math.sin(aside_rad))
    along = math.acos(min(1.0, math.cos(from_start) / math.cos(across)))
    if along * EARTH_RADIUS_M > leg.span_m:
        return distance_m(end, position)
    return abs(across) * EARTH_RADIUS_M


class LegCache:
    """Caches the leg under way and the legs ahead until the logbook changes them."""

    __slots__ = ("_ahead", "_leg", "_load_kg", "_model", "_seen")

    def __init__(self, model: DroneModel) -> None:
        self._model = model
        self._leg: Leg | None = None
        self._load_kg = 0.0
        self._ahead: tuple[Leg, ...] = ()
        self._seen: tuple[object, object] = (None, None)

    def leg(self, step: FlyStep, *, load_kg: float) -> Leg:
        """The leg under way; the same object as long as the step is the same."""
        leg = self._leg
        if leg is None or leg.step is not step or self._load_kg != load_kg:
            leg = self._leg = leg_of(step, model=self._model, load_kg=load_kg)
            self._load_kg = load_kg
        return leg

    def ahead(self, logbook: Logbook) -> tuple[Leg, ...]:
        """The next flights up to the next recharge."""
        mission = logbook.mission
        seen = (mission.steps if mission else None, logbook.packages)
        if seen[0] is not self._seen[0] or seen[1] is not self._seen[1]:
            self._seen = seen
            self._ahead = (
                legs_ahead(mission, packages=logbook.packages, model=self._model) if mission else ()
            )
        return self._ahead

    def released(self, logbook: Logbook, leg: Leg | None) -> tuple[Leg, ...]:
        """The flights from the leg under way, or from the station below, to the next landing."""
        mission = logbook.mission
        if leg is None and (mission is None or logbook.station_id is not None):
            return ()
        flights: list[Leg] = []
        for flight in self.ahead(logbook):
            if leg is not None and not flights and flight.step is not leg.step:
                # The leg is not in the plan: its end is the next landing.
                break
            flights.append(flight)
            if flight.step.lands:
                break
        return tuple(flights) if flights else (leg,) if leg else ()
