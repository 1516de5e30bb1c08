"""Proves which order of the trips of a small fleet costs least, by branch and bound.

A node is the beginning of an order: trips that the exact planner has planned one after another,
each as early as it can be. A branch adds a trip of one drone. The bound of a node counts what its
trips cost, and what each other request costs at least (Land and Doig 1960).
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import Final

import numpy as np

from skyway.dispatch.objective import Limits, lateness_of
from skyway.dispatch.planned_trip import DroneTrip, PlannedTrip, Pool
from skyway.dispatch.row_bounds import RowBounds, least_shared_out, shared_out
from skyway.dispatch.schedule import Calendar, Schedule, Scheduler
from skyway.planner.kernels.memory import Floats

#: A node is left out if its bound is not lower than the best schedule by so much, seconds. Sums in
#: another order may differ by less.
_EQUAL_S: Final = 1e-6

#: Later than every delivery, seconds.
_NEVER_S: Final = 1e12

#: The trips that may come next, by drone and requests; None if there is no such trip.
_Next = Mapping[tuple[int, Pool], PlannedTrip | None]


@dataclass(frozen=True, slots=True)
class _Node:
    """Trips in the order in which they are planned, what they cost, and a bound of all costs.

    `planned` are the numbers of its trips. `before` are the trips that could come instead of the
    last one.
    """

    trips: tuple[DroneTrip, ...]
    planned: frozenset[int]
    cost_s: float
    bound_s: float
    before: _Next


class BestOrder:
    """The branch and bound of one problem. When it is done, no order costs less than the best."""

    def __init__(self, scheduler: Scheduler, limits: Limits) -> None:
        self._scheduler = scheduler
        self._limits = limits
        requests = range(len(scheduler.problem.requests))
        most = scheduler.problem.most_pooled
        self._pools = [
            pool
            for size in range(1, most + 1)
            for pool in combinations(requests, size)
            if scheduler.planner.sharing.allows(pool)
        ]
        self._rows = RowBounds(
            scheduler.problem,
            scheduler.estimates,
            kinds=scheduler.planner.model_of,
            pools=self._pools,
            latest_s=limits.latest_s,
        )
        #: The number of each trip that was looked at, and its cost.
        self._known: dict[DroneTrip, tuple[int, float]] = {}
        #: The trips of every node so far: in another order they leave the same calendar.
        self._seen: set[frozenset[int]] = set()
        self._open = [_Node((), frozenset(), 0.0, 0.0, {})]

    @property
    def is_done(self) -> bool:
        """Whether no order is left that may cost less."""
        return not self._open

    def step(self, best: Schedule) -> Schedule:
        """Look at one node; the best schedule that was found, or the one that is given."""
        while self._open and self._open[-1].bound_s > best.costs.total_s - _EQUAL_S:
            self._open.pop()
        return self._branch(self._open.pop(), best) if self._open else best

    def _branch(self, node: _Node, best: Schedule) -> Schedule:
        """Open the branches of a node. If there are none, its order is complete."""
        calendar = Calendar(self._scheduler.planner, self._scheduler.estimates)
        for drone, each in node.trips:
            calendar.add(each, drone)
        following = dict(self._following(calendar, node))
        if not any(following.values()):
            found = self._scheduler.in_order(tuple((drone, one.pool) for drone, one in node.trips))
            is_better = found.costs.total_s < best.costs.total_s
            return found if is_better and self._limits.are_kept(found.costs) else best
        left, alone_s, others_s = self._left(calendar, following, best.costs.total_s)
        branches = []
        for (drone, pool), trip in following.items():
            if trip is None or self._is_late(trip):
                continue
            added = DroneTrip(drone, trip)
            number, own_cost_s = self._number_and_cost(added)
            planned = node.planned | {number}
            if planned in self._seen:
                continue
            self._seen.add(planned)
            cost_s = node.cost_s + own_cost_s
            rest = left ^ sum(1 << each for each in pool)
            own_s = np.maximum(
                self._rows.of(*calendar.after(added), rest, most_s=best.costs.total_s),
                alone_s[drone],
            )
            bound_s = cost_s + least_shared_out(own_s, others_s[drone], rest)
            if bound_s <= best.costs.total_s - _EQUAL_S:
                branches.append(_Node((*node.trips, added), planned, cost_s, bound_s, following))
        self._open += sorted(branches, key=lambda each: -each.bound_s)
        return best

    def _number_and_cost(self, added: DroneTrip) -> tuple[int, float]:
        found = self._known.get(added)
        if found is None:
            cost_s = self._scheduler.pricing.costs((added,), ()).total_s
            found = self._known[added] = len(self._known), cost_s
        return found

    def _following(
        self, calendar: Calendar, node: _Node
    ) -> Iterator[tuple[tuple[int, Pool], PlannedTrip | None]]:
        """The trips that may come next, by drone and requests."""
        served = {number for _, trip in node.trips for number in trip.pool}
        last = node.trips[-1].drone if node.trips else -1
        pools = [each for each in self._pools if served.isdisjoint(each)]
        for drone in range(len(calendar.slots)):
            if last in (drone, -1):
                calendar.foresee(pools, drone)
        for pool in pools:
            for drone in range(len(calendar.slots)):
                key = (drone, pool)
                before = node.before.get(key)
                # The trip that was best before the last trip was added is still best if it fits.
                if drone != last and key in node.before and calendar.has_room(before):
                    yield key, before
                else:
                    yield key, calendar.plan(pool, drone)

    def _left(
        self, calendar: Calendar, following: _Next, most_s: float
    ) -> tuple[int, Floats, list[Floats]]:
        """The set of requests that are left, and what each set of them costs at least.

        First if a drone serves each request next, ``(drones, sets)``. Then for each drone if all
        other drones share the set out, or leave some requests unserved, ``(sets,)``.
        """
        requests = self._scheduler.problem.requests
        next_s = np.zeros((len(calendar.slots), len(requests)))
        left = 0
        for (drone, pool), trip in following.items():
            if len(pool) == 1:
                (number,) = pool
                moment_ms = math.inf if trip is None else trip.delivered_ms[0]
                # A shared trip may be loaded at another pickup.
                for pickup in requests[number].pickups:
                    moment_ms = min(moment_ms, calendar.least_end_ms(pool, drone, pickup))
                next_s[drone, number] = self._cost_s(number, moment_ms / 1000)
                left |= 1 << number
        alone_s = next_s @ self._rows.members.T
        rows = [
            np.maximum(self._rows.of(*calendar.kind_and_slot(drone), left, most_s=most_s), each)
            for drone, each in enumerate(alone_s)
        ]
        others = []
        for drone in range(len(rows)):
            shared = self._rows.unserved_s
            for other, row in enumerate(rows):
                if other != drone:
                    shared = shared_out(shared, row, left)
            others.append(shared)
        return left, alone_s, others

    def _cost_s(self, number: int, moment_s: float) -> float:
        """What a request costs if it is served no sooner than at this moment."""
        request, prices = self._scheduler.problem.requests[number], self._scheduler.problem.prices
        unserved_s = request.weight * (prices.unserved_s - request.known_s)
        if moment_s > self._limits.latest_s.get(number, _NEVER_S):
            return unserved_s
        waited_s = prices.delivery * (moment_s - request.known_s)
        late_s = prices.lateness * lateness_of(request.due_s, moment_s)
        return min(unserved_s, request.weight * (waited_s + late_s))

    def _is_late(self, trip: PlannedTrip) -> bool:
        """Whether the trip breaks a promise."""
        return any(
            moment_ms / 1000 > self._limits.latest_s.get(number, math.inf)
            for number, moment_ms in zip(trip.pool, trip.delivered_ms, strict=True)
        )
