"""The paper's matrix of delivery times, and orders of destinations by it, the cheapest first.

An entry is the least time of a leg for the chosen drone. The load falls along the way, so it
depends on what is still on board. Its times are lower bounds: no recharging is faster than the
charge curve just above the reserve, and no pad is taken.
"""

import heapq
import math
from collections.abc import Callable, Iterator
from functools import cache

from skyway.drone.charging import fastest_s_per_soc
from skyway.drone.flight import flight_energy_j, flight_time_s
from skyway.planner.situation import Situation
from skyway.planner.subnetwork import Subnetwork

#: cost(at, to, undelivered): from destination `at` (`SOURCE` is the source) to destination `to`
#: while the destinations in the bit set `undelivered` still wait, `to` among them.
LegCost = Callable[[int, int, int], float]

SOURCE = -1


def orders_by_cost(destinations: int, cost: LegCost) -> Iterator[tuple[float, tuple[int, ...]]]:
    """All orders of so many destinations with their finite costs, the cheapest first.

    Best-first search over the beginnings of orders; what an order still costs is known exactly,
    by a dynamic programme over subsets (Held and Karp 1962), so the first order takes no search.
    """

    @cache
    def still_costs(at: int, undelivered: int) -> float:
        return min(
            (
                cost(at, to, undelivered) + still_costs(to, undelivered & ~(1 << to))
                for to in _members(undelivered)
            ),
            default=0.0,
        )

    everything = (1 << destinations) - 1
    beginnings: list[tuple[float, tuple[int, ...], float, int]] = [
        (still_costs(SOURCE, everything), (), 0.0, everything)
    ]
    while beginnings and beginnings[0][0] < math.inf:
        total, order, so_far, undelivered = heapq.heappop(beginnings)
        if not undelivered:
            yield total, order
            continue
        at = order[-1] if order else SOURCE
        for to in _members(undelivered):
            cost_to = so_far + cost(at, to, undelivered)
            left = undelivered & ~(1 << to)
            heapq.heappush(
                beginnings, (cost_to + still_costs(to, left), (*order, to), cost_to, left)
            )


def _members(bit_set: int) -> Iterator[int]:
    member = 0
    while bit_set >> member:
        if bit_set >> member & 1:
            yield member
        member += 1


class TimeMatrix:
    """Least times from the source and every destination to every destination.

    Destinations go by their number in `situation.destinations`, sets of them by their bits.
    """

    def __init__(
        self, situation: Situation, subnetwork: Subnetwork, *, approach: Subnetwork
    ) -> None:
        self._situation = situation
        model, problem = situation.model, situation.problem
        #: ``(n + 1, n)`` metres, row = from, the last row (number -1) the source.
        self._lengths_m = _lengths_m(situation, subnetwork)
        self._s_per_m = cache(self._flight_s_per_m)
        self._j_per_m = cache(self._flight_j_per_m)
        self._s_per_j = fastest_s_per_soc(situation.fastest_model) / model.battery_j
        self._usable_j = (problem.drone.soc - model.reserve_soc) * model.battery_j
        self._before = self._before_the_first_leg(approach)
        self._each_end_s = model.stop_s + problem.dropoff_s
        self._each_end_and_recharge_s = self._each_end_s + model.stop_j * self._s_per_j

    def flight_s(self, at: int, to: int, undelivered: int) -> float:
        """Time of a leg without recharging, its landing and hand-over included."""
        return self._lengths_m[at][to] * self._s_per_m(undelivered) + self._each_end_s

    def flight_and_recharge_s(self, at: int, to: int, undelivered: int) -> float:
        """Time of a leg, with the time to recharge the energy that it uses."""
        s_per_m = self._s_per_m(undelivered) + self._j_per_m(undelivered) * self._s_per_j
        return self._lengths_m[at][to] * s_per_m + self._each_end_and_recharge_s

    def delivery_bound_s(self, flight_and_recharge_s: float) -> float:
        """A delivery with this sum of legs cannot end earlier."""
        before_s, before_j = self._before
        recharge_s = (before_j - self._usable_j) * self._s_per_j
        return before_s + recharge_s + flight_and_recharge_s

    def lower_bound_s(self) -> float:
        """No plan delivers everything earlier; infinite when some destination is out of reach."""
        numbers = len(self._situation.destinations)
        least_flight_s, _ = next(orders_by_cost(numbers, self.flight_s), (math.inf, ()))
        least_both_s, _ = next(orders_by_cost(numbers, self.flight_and_recharge_s), (math.inf, ()))
        before_s, _ = self._before
        return max(before_s + least_flight_s, self.delivery_bound_s(least_both_s))

    def _before_the_first_leg(self, approach: Subnetwork) -> tuple[float, float]:
        """Least time and energy of the approach flight, loading, and a hand-over at the source."""
        model, problem = self._situation.model, self._situation.problem
        before_s, before_j = problem.loading.takes_s, 0.0
        if problem.start_station_id != problem.source:
            lengths = approach.lengths_to_m(problem.source)
            length_m = lengths.get(problem.start_station_id, math.inf)
            before_s += flight_time_s(model, length_m=length_m, load_kg=0.0) + model.stop_s
            before_j += flight_energy_j(model, length_m=length_m, load_kg=0.0) + model.stop_j
        if self._situation.packages_for(problem.source):
            before_s += problem.dropoff_s
        return before_s, before_j

    def _flight_s_per_m(self, undelivered: int) -> float:
        load_kg = self._load_kg(undelivered)
        return flight_time_s(self._situation.model, length_m=1.0, load_kg=load_kg)

    def _flight_j_per_m(self, undelivered: int) -> float:
        load_kg = self._load_kg(undelivered)
        return flight_energy_j(self._situation.model, length_m=1.0, load_kg=load_kg)

    def _load_kg(self, undelivered: int) -> float:
        waiting = {
            station_id
            for number, station_id in enumerate(self._situation.destinations)
            if undelivered >> number & 1
        }
        return self._situation.load_kg(waiting)


def _lengths_m(situation: Situation, subnetwork: Subnetwork) -> list[list[float]]:
    """The length of the shortest path of every leg; infinite without a path."""
    trees = [subnetwork.lengths_to_m(target) for target in situation.destinations]
    starts = (*situation.destinations, situation.problem.source)
    return [[tree.get(start, math.inf) for tree in trees] for start in starts]
