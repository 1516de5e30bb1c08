"""Proves that no fleet plan of a problem has a lower objective than this bound.

The bound is a Lagrangian relaxation (Fisher 1981). Each request gets a price. Each drone flies the
trips that cost least, where each visit of a request earns its price. Every plan costs at least the
sum of all prices and of these least costs. This holds for any prices; subgradient steps find good
ones. `estimates` gives the trips, which are never longer than real trips. docs/dispatch.md gives
the proof.
"""

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from skyway.dispatch.estimates import Estimates
from skyway.dispatch.objective import Costs
from skyway.dispatch.planned_trip import Pool
from skyway.dispatch.problem import FleetProblem
from skyway.dispatch.row_bounds import RowBounds, first_costs_s, is_small
from skyway.dispatch.walks import (
    LONGEST_S,
    Start,
    Walks,
    has_short_trips,
    sources_of,
    starts_of,
    walks_of,
)
from skyway.planner.kernels.fleet_bound import fill_future, least_walk
from skyway.planner.kernels.memory import Floats, Longs

#: With more nodes, only the first trip of each drone is computed with its own times.
_MOST_NODES_FOR_TWO: Final = 400

#: With more trips only the weaker bound is given: each set of requests counts once for each of its
#: pickups. Estimates of so many take a second or two for each model. Our own choice.
_MOST_TRIPS: Final = 50_000

#: After so many steps without a better bound the step is halved. The search ends at the shortest
#: step. Our own choice.
_MOST_FAILURES: Final = 15
_SHORTEST_STEP: Final = 0.005

#: The most cells of all steps together, about a minute, and the least number of steps. Our own
#: choice.
_MOST_CELLS: Final = 2e9
_LEAST_STEPS: Final = 20

#: The share of the earlier directions in each direction.
_MEMORY: Final = 0.6

#: The horizon, as a multiple of the last delivery of the good plan.
_HORIZONS: Final = 1.2


def lower_bound_s(
    problem: FleetProblem,
    estimates: Estimates,
    *,
    kinds: Sequence[int],
    pools: Sequence[Pool] | None,
    upper: Costs,
    is_over: Callable[[int], bool],
) -> float:
    """No plan of the problem has a lower objective than this.

    It is 0 if a model flies faster with a load: then packages of others may make a trip sooner.

    Parameters
    ----------
    kinds
        The number of each drone's model, as `estimates` counts them.
    pools
        All sets of requests that may share a trip, single requests too; None if they are too many.
    upper
        The costs of a good plan; they guide the steps.
    is_over
        Called with the number of steps; True ends them.
    """
    if not problem.requests or problem.prices.delivery <= 0 or not upper.delivered_s:
        return 0.0
    if not problem.has_slow_loads:
        return 0.0
    starts = starts_of(problem, estimates, kinds)
    alone_s = float(first_costs_s(problem, estimates, kinds).sum())
    if pools is not None and is_small(problem):
        return max(alone_s, RowBounds(problem, estimates, kinds=kinds, pools=pools).fleet_s())
    horizon_s = min(
        _HORIZONS * max(upper.delivered_s.values()),
        min(each.charged_s for each in starts) + LONGEST_S,
    )
    if (
        pools is None
        or sum(len(estimates.pickups(each)) for each in pools) > _MOST_TRIPS
        or has_short_trips(estimates, kinds, pools)
    ):
        return alone_s
    sources = sources_of(problem, estimates)
    made = [
        walks_of(problem, estimates, kind, pools, starts, sources, horizon_s)
        for kind in range(max(kinds) + 1)
    ]
    relaxation = _Relaxation(problem, made, starts, sources, horizon_s)
    return max(alone_s, relaxation.best(upper, is_over))


class _Relaxation:
    """The Lagrangian relaxation, and the search for good prices."""

    def __init__(
        self,
        problem: FleetProblem,
        kinds: Sequence[Walks],
        starts: Sequence[Start],
        sources: Longs,
        horizon_s: float,
    ) -> None:
        self._problem = problem
        self._kinds = kinds
        self._starts = starts
        cells = sum(len(each.nodes.pool) * each.future.cost.shape[1] for each in kinds)
        self._most_steps = max(_LEAST_STEPS, int(_MOST_CELLS / cells))
        self._sources = sources
        prices = problem.prices
        # The first value: with a higher price, a trip after the horizon could cost less than 0.
        # The second value: with a higher price, leaving the request unserved would cost less.
        self._most = np.array(
            [
                each.weight
                * min(
                    prices.delivery * (horizon_s - each.known_s), prices.unserved_s - each.known_s
                )
                for each in problem.requests
            ]
        )

    def best(self, upper: Costs, is_over: Callable[[int], bool]) -> float:
        """The best bound found by subgradient steps (Held, Wolfe and Crowder 1974)."""
        requests = self._problem.requests
        price = np.array(
            [
                each.weight * (upper.delivered_s.get(number, 0.0) - each.known_s)
                for number, each in enumerate(requests)
            ]
        )
        price = np.minimum(price, self._most)
        best_s, best_price, direction = -np.inf, price, np.zeros(len(requests))
        step, failures, steps = 1.0, 0, 0
        while (
            step > _SHORTEST_STEP
            and steps < self._most_steps
            and (steps == 0 or not is_over(steps))
        ):
            bound_s, visits = self._at(price)
            steps += 1
            if bound_s > best_s:
                best_s, best_price, failures = bound_s, price, 0
            else:
                failures += 1
            if failures >= _MOST_FAILURES:
                step, failures, price = step / 2, 0, best_price
                direction[:] = 0.0
                continue
            slope = 1.0 - visits
            direction = _MEMORY * direction + (1.0 - _MEMORY) * slope
            norm = float(direction @ direction)
            if norm < 1e-9:
                break
            missing_s = max(1.0, upper.total_s - bound_s)
            price = price + step * missing_s / norm * direction
            price = np.clip(price, 0.0, self._most)
        return best_s

    def _at(self, price: Floats) -> tuple[float, Longs]:
        """The bound with these prices, and how often the drones visit each request."""
        visits = np.zeros(len(price), np.int64)
        bound_s = float(price.sum())
        for each in self._kinds:
            each.nodes.price[:] = price
            fill_future(each.nodes, each.approach, self._sources, each.future)
        for start in self._starts:
            each = self._kinds[start.kind]
            bound_s += least_walk(
                each.nodes,
                each.approach,
                self._sources,
                each.future,
                start.place,
                start.free_s,
                start.charged_s,
                2 if len(each.nodes.pool) <= _MOST_NODES_FOR_TWO else 1,
                visits,
            )
        return bound_s, visits
