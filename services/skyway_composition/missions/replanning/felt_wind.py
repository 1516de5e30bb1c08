"""The energy of a drone's next flights in the wind that it feels, and in the weather of its plan.

A drone judges its next flights in the wind that it feels, and the plan is checked in it too. A plan
with less energy would be refused, or replaced by another plan a moment later.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import zip_longest
from typing import Final

from skyway.contracts.drone_report import Wind
from skyway.contracts.flight_step import (
    DeliverStep,
    FlightStep,
    FlyStep,
    PickUpStep,
    RechargeStep,
    ReturnStep,
)
from skyway.delivery.plan import Fly, Recharge, Step
from skyway.drone.flight import flight_energy_j, speed_mps
from skyway.drone.model import DroneModel
from skyway.geo import bearing_rad
from skyway.ids import PackageId
from skyway.network.network import Network
from skyway.scheduling.trip import Trip
from skyway_composition.planning.problem_for import planned_more

#: Joules that a flight needs in still air, and by how much the weather multiplies them.
FlightInAir = tuple[float, float]

#: The least ground speed as a share of the air speed, as drones count it.
_LEAST_SHARE: Final = 0.1


def felt_margin(
    wind: Wind | None, trip: Trip, network: Network, *, model: DroneModel, lasting_factor: float
) -> float:
    """The energy margin that the next flights of this trip need; 0 if the planned energy is enough.

    These are the flights up to the recharge after them, as in the drone's `consumption_factor`.
    `lasting_factor` is what the drone uses without the wind.
    """
    if wind is None:
        return 0.0
    planned_j = felt_j = 0.0
    for flight in _flights_of(trip):
        planned_j += flight.energy_j
        still_j = flight.energy_j / (flight.time_factor * flight.energy_factor)
        start, end = network.stations[flight.from_id], network.stations[flight.to_id]
        felt_j += still_j * _slowness(
            wind,
            bearing=bearing_rad(start.position, end.position),
            air_speed_mps=speed_mps(model, flight.load_kg),
        )
    felt_j *= lasting_factor
    return planned_more(felt_j / planned_j) if planned_j else 0.0


def air_ahead(flights: Iterable[FlightInAir]) -> float:
    """By how much the weather multiplies the energy of all these flights together.

    The drone counts in the same way: a long flight counts more than a short one. Flights over
    segments that the weather closes are left out.
    """
    still_j = in_air_j = 0.0
    for flight_j, factor in flights:
        if factor == math.inf:
            continue
        still_j += flight_j
        in_air_j += flight_j * factor
    return in_air_j / still_j if still_j else 1.0


def first_flights(steps: Sequence[Step], model: DroneModel) -> Iterator[FlightInAir]:
    """The flights of a plan of this model up to the recharge after them, without landings."""
    has_flown = False
    for step, following in zip_longest(steps, steps[1:]):
        if isinstance(step, Recharge) and has_flown:
            return
        if isinstance(step, Fly):
            factor = step.time_factor * step.energy_factor
            landing_j = 0.0 if isinstance(following, Fly) else model.stop_j
            yield max(0.0, step.energy_j - landing_j) / factor, factor
            has_flown = True


def planned_air(flight: FlyStep) -> float:
    """By how much the weather of its plan multiplies the energy of a flight."""
    return flight.time_factor * flight.energy_factor


def next_flights(
    steps: Iterable[FlightStep],
    model: DroneModel,
    *,
    masses_kg: Mapping[PackageId, float],
    carried: Iterable[PackageId],
    air: Callable[[FlyStep], float],
) -> Iterator[FlightInAir]:
    """The flights of these steps up to the recharge after them, in this `air`.

    The packages in `carried` are on board before the first step.
    """
    on_board, has_flown = {*carried}, False
    for step in steps:
        match step:
            case RechargeStep() if has_flown:
                return
            case PickUpStep():
                on_board.update(each.package_id for each in step.packages)
            case DeliverStep() | ReturnStep():
                on_board.difference_update(step.package_ids)
            case FlyStep():
                load_kg = sum(masses_kg.get(each, 0.0) for each in on_board)
                still_j = flight_energy_j(model, length_m=step.length_m, load_kg=load_kg)
                yield still_j, air(step)
                has_flown = True


def _flights_of(trip: Trip) -> Iterator[Fly]:
    """The flights up to the recharge after them."""
    has_flown = False
    for placed in trip.steps():
        if isinstance(placed.step, Recharge) and has_flown:
            return
        if isinstance(placed.step, Fly):
            has_flown = True
            yield placed.step


def _slowness(wind: Wind, *, bearing: float, air_speed_mps: float) -> float:
    """How many times longer a flight takes in this wind."""
    sine, cosine = math.sin(bearing), math.cos(bearing)
    along = wind.east_mps * sine + wind.north_mps * cosine
    across = wind.east_mps * cosine - wind.north_mps * sine
    held = air_speed_mps**2 - across**2
    least = _LEAST_SHARE * air_speed_mps
    ground_mps = max(least, along + math.sqrt(held)) if held > 0.0 else least
    return air_speed_mps / ground_mps
