"""What a schedule costs, and which limits it must keep against the baseline."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final

from skyway.dispatch.planned_trip import DroneTrip
from skyway.dispatch.problem import FleetProblem

#: Joules of a kilowatt-hour.
J_PER_KWH: Final = 3.6e6


@dataclass(frozen=True, slots=True)
class Costs:
    """The parts of the objective of one schedule.

    Parameters
    ----------
    total_s
        The objective, in seconds of one request of weight 1.
    delivered_s
        When the last package of each served request is delivered, by the request's number.
    delivery_s, lateness_s
        Sums over the served requests, by weight.
    moves
        Served requests that another drone flies than in the current plan.
    flown
        How many requests each provider flies.
    """

    total_s: float
    delivered_s: Mapping[int, float]
    delivery_s: float
    lateness_s: float
    energy_j: float
    moves: int
    unserved: int
    flown: Mapping[str, int]


class Pricing:
    """The prices of a problem."""

    def __init__(self, problem: FleetProblem) -> None:
        self._problem = problem

    def costs(self, trips: Iterable[DroneTrip], unserved: Iterable[int]) -> Costs:
        """What these trips cost."""
        requests, drones = self._problem.requests, self._problem.drones
        delivered_s: dict[int, float] = {}
        delivery_s = lateness_s = energy_j = 0.0
        moves = 0
        flown = dict.fromkeys((each.provider_id for each in drones), 0)
        for drone, trip in trips:
            energy_j += trip.energy_j
            flown[drones[drone].provider_id] += len(trip.pool)
            for number, moment_ms in zip(trip.pool, trip.delivered_ms, strict=True):
                request, moment_s = requests[number], moment_ms / 1000
                delivered_s[number] = moment_s
                delivery_s += request.weight * (moment_s - request.known_s)
                lateness_s += request.weight * lateness_of(request.due_s, moment_s)
                planned = request.planned
                moves += planned is not None and planned.drone_id != drones[drone].drone_id
        left = [requests[each] for each in unserved]
        prices = self._problem.prices
        total_s = (
            prices.delivery * delivery_s
            + prices.lateness * lateness_s
            + prices.energy_s_per_kwh * energy_j / J_PER_KWH
            + prices.move_s * moves
            + sum(each.weight * (prices.unserved_s - each.known_s) for each in left)
        )
        return Costs(
            total_s, delivered_s, delivery_s, lateness_s, energy_j, moves, len(left), flown
        )


def promised_s(problem: FleetProblem) -> dict[int, float]:
    """The end of the tolerance of each request with a promise, by its number."""
    return {
        number: request.promised_s + problem.promise_tolerance_s
        for number, request in enumerate(problem.requests)
        if request.promised_s is not None
    }


def lateness_of(due_s: float | None, moment_s: float) -> float:
    """Seconds after the moment at which something is due; 0 if it is in time."""
    return 0.0 if due_s is None else max(0.0, moment_s - due_s)


class Limits:
    """What a plan must keep: promises, fairness, and the number of unserved requests.

    `latest_s` is the latest delivery of each request with a promise: the promise plus the
    tolerance. If the baseline delivers later, it is the delivery there; with the arrival order as
    baseline, the tolerance is added to that. `flown` is the least number of requests that each
    provider flies.
    """

    def __init__(self, problem: FleetProblem, baseline: Costs) -> None:
        added_s = 0.0 if problem.baseline == "current plan" else problem.promise_tolerance_s
        self.latest_s = {
            number: max(moment_s, baseline.delivered_s.get(number, -math.inf) + added_s)
            for number, moment_s in promised_s(problem).items()
        }
        self._served = {each for each in self.latest_s if each in baseline.delivered_s}
        self.flown = baseline.flown if problem.fairness == "requests" else {}
        self._unserved = baseline.unserved

    def are_kept(self, costs: Costs) -> bool:
        """Whether a plan with these costs keeps all limits."""
        return (
            costs.unserved <= self._unserved
            and costs.delivered_s.keys() >= self._served
            and all(costs.flown[each] >= least for each, least in self.flown.items())
            and all(
                costs.delivered_s.get(number, latest_s) <= latest_s
                for number, latest_s in self.latest_s.items()
            )
        )
