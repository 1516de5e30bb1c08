"""The energy that a new plan needs in the wind that its drone feels.

A drone judges its next flights in this wind, and the plan is checked in it too. A plan with less
energy would be refused, or replaced by another plan a moment later.
"""

import math
from collections.abc import Iterator
from typing import Final

from skyway.contracts.drone_report import Wind
from skyway.delivery.plan import Fly, Recharge
from skyway.drone.flight import speed_mps
from skyway.geo import bearing_rad
from skyway.network.network import Network
from skyway.scheduling.trip import Trip
from skyway_composition.missions.replanning.situation import Situation
from skyway_composition.planning.problem_for import planned_more

#: The least ground speed as a share of the air speed, as drones count it.
_LEAST_SHARE: Final = 0.1


def felt_margin(situation: Situation, trip: Trip, network: Network) -> float:
    """The energy margin that the next flights of this trip need; 0 if the planned energy is enough.

    These are the flights up to the recharge after them, as in the drone's `consumption_factor`.
    """
    state, candidate = situation.link.state, situation.record.candidate
    health = None if state is None else state.health
    if health is None or health.wind is None:
        return 0.0
    planned_j = felt_j = 0.0
    for flight in _next_flights(trip):
        planned_j += flight.energy_j
        still_j = flight.energy_j / (flight.time_factor * flight.energy_factor)
        start, end = network.stations[flight.from_id], network.stations[flight.to_id]
        felt_j += still_j * _slowness(
            health.wind,
            bearing=bearing_rad(start.position, end.position),
            air_speed_mps=speed_mps(candidate.model, flight.load_kg),
        )
    felt_j *= situation.lasting_factor
    return planned_more(felt_j / planned_j) if planned_j else 0.0


def _next_flights(trip: Trip) -> Iterator[Fly]:
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
