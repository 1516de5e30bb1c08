"""The bounds that guide an exact search, worked out over all orders of the destinations."""

import math
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from skyway.drone.charging import fastest_s_per_soc, recharge_time_s
from skyway.drone.flight import MASS_EXPONENT, flight_energy_j, flight_time_s
from skyway.drone.model import DroneModel
from skyway.geo import distance_m
from skyway.planner.kernels.bounds import fill_orders
from skyway.planner.kernels.memory import Floats, Ints
from skyway.planner.situation import Situation

#: How much longer the way along segments is than the straight line. Our own choice.
_DETOUR = 1.2

Number = TypeVar("Number", float, Floats)


@dataclass(frozen=True, slots=True)
class Legs:
    """What flying costs by mask; ``(2**k + 1,)`` each, the last row is the approach."""

    s_per_m: Floats
    j_per_m: Floats


def legs_of(situation: Situation) -> Legs:
    """Seconds and joules per metre for every set of packages on board."""
    model, destinations = situation.model, situation.destinations
    masses_kg = [
        math.fsum(package.mass_kg for package in situation.packages_for(destination))
        for destination in destinations
    ]
    masks = np.arange(1 << len(destinations))
    loads_kg = np.zeros(len(masks) + 1)
    for number, mass_kg in enumerate(masses_kg):
        loads_kg[:-1] += np.where(masks >> number & 1, 0.0, mass_kg)
    # `skyway.drone` computes one load at a time; here are thousands, by the same formulas.
    share_of_payload = loads_kg / model.max_payload_kg
    speeds_mps = model.speed_empty_mps + share_of_payload * (
        model.speed_full_mps - model.speed_empty_mps
    )
    powers_w = model.power_empty_w * (1.0 + loads_kg / model.empty_mass_kg) ** MASS_EXPONENT
    s_per_m = 1.0 / speeds_mps
    return Legs(s_per_m, powers_w * s_per_m)


@dataclass(frozen=True, slots=True)
class BoundWeights:
    """The weights of a bound: for each second flown and for each joule used."""

    per_second: float
    per_joule: float

    def of(self, seconds: Number, joules: Number) -> Number:
        """The weighted sum of these seconds and joules."""
        return self.per_second * seconds + self.per_joule * joules


@dataclass(frozen=True, slots=True)
class Bound:
    """The least remaining cost, by these weights.

    `per_m` is by mask, ``(2**k + 1,)``; ``after[mask, j]`` what follows once destination j is
    reached; `least` the least of all from the source.
    """

    weights: BoundWeights
    per_m: Floats
    after: Floats
    least: float


def bounds_of(
    situation: Situation, legs: Legs, *, guide: str, required: Ints, apart_m: Floats
) -> tuple[Bound, Bound]:
    """The bound by flight time alone, and the bound by the need to charge (see `Task`).

    Parameters
    ----------
    guide
        A method's `bound`.
    required
        ``(k,)``, what must be delivered before each destination, as a mask.
    apart_m
        ``(k + 1, k)``, from each destination and at last the source, to each destination.
    """
    policy = situation.problem.recharge_policy
    flying, needing = (
        _bound(situation, legs, weights, required, apart_m)
        for weights in _weights_of(situation.fastest_model, policy, guide)
    )
    return flying, needing


def _weights_of(
    model: DroneModel, recharge_policy: str, guide: str
) -> tuple[BoundWeights, BoundWeights]:
    """The weights of both bounds: flight time alone, and the need to charge (see `Task`).

    Just above the reserve the concave curve is fastest; sessions that go on to its top are counted
    by their joules, whose time is worked out from what is on board.
    """
    if guide == "none":
        return BoundWeights(0.0, 0.0), BoundWeights(0.0, 0.0)
    flying = BoundWeights(1.0, 0.0)
    if recharge_policy == "full":
        return flying, BoundWeights(0.0, 1.0 if guide == "full" else 0.0)
    s_per_j = fastest_s_per_soc(model) / model.battery_j
    return flying, BoundWeights(1.0, s_per_j if guide == "full" else 0.0)


def _bound(
    situation: Situation, legs: Legs, weights: BoundWeights, required: Ints, apart_m: Floats
) -> Bound:
    model, count = situation.model, len(situation.destinations)
    finish_j = np.array([situation.finish_j(each) for each in situation.destinations])
    is_out_of_reach = np.isinf(finish_j)
    per_m = weights.of(legs.s_per_m, legs.j_per_m)
    after = np.empty((1 << count, count))
    # With windows the drone may have landed before it hands over.
    stop_s, stop_j = (0.0, 0.0) if situation.windows.may_pass else (model.stop_s, model.stop_j)
    least = fill_orders(
        apart_m,
        required,
        per_m,
        weights.of(stop_s + situation.problem.dropoff_s, stop_j),
        np.where(
            is_out_of_reach, np.inf, weights.per_joule * np.where(is_out_of_reach, 0, finish_j)
        ),
        after,
    )
    return Bound(weights, per_m, after, least)


def likely_delivery_s(situation: Situation) -> float:
    """A guess at the time of the best plan in still air: always to the nearest destination.

    It only decides how many periods of the weather a search looks at first.
    """
    problem, model, stations = situation.problem, situation.model, situation.network.stations
    left = list(situation.destinations)
    route = [] if problem.start_station_id == problem.source else [problem.source]
    here, load_kg, used_j = problem.start_station_id, 0.0, 0.0
    at_s = max((first_s for first_s, _ in situation.windows.limits.values()), default=0.0)
    at_s = max(at_s, 0.0) + problem.loading.takes_s
    while route or left:
        if not route:
            load_kg = situation.load_kg(set(left))
            position = stations[here].position
            route = [min(left, key=lambda one: distance_m(position, stations[one].position))]
            left.remove(route[0])
            at_s += problem.dropoff_s
        reached = route.pop()
        length_m = _DETOUR * distance_m(stations[here].position, stations[reached].position)
        at_s += flight_time_s(model, length_m=length_m, load_kg=load_kg) + model.stop_s
        used_j += flight_energy_j(model, length_m=length_m, load_kg=load_kg) + model.stop_j
        here = reached
    missing_j = used_j - (problem.drone.soc - model.reserve_soc) * model.battery_j
    s_per_soc = fastest_s_per_soc(situation.fastest_model)
    if problem.recharge_policy == "full":
        s_per_soc = recharge_time_s(model, model.reserve_soc, model.top_soc)
        s_per_soc /= model.top_soc - model.reserve_soc
    return at_s + max(0.0, missing_j) / model.battery_j * s_per_soc
