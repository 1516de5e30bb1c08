"""What the trips that are left cost at least, for each set of requests, by estimates.

A set of requests is a number whose bit r says that request r belongs to it.
"""

import math
from collections.abc import Mapping, Sequence
from functools import cache, reduce
from types import MappingProxyType
from typing import Final

import numpy as np

from skyway.dispatch.estimates import Estimates
from skyway.dispatch.planned_trip import Pool
from skyway.dispatch.problem import FleetProblem
from skyway.dispatch.walks import nodes_of, sources_of
from skyway.planner.kernels.fleet_bound import Nodes
from skyway.planner.kernels.fleet_rows import MOST_LABELS, RowTask, least_rows
from skyway.planner.kernels.fleet_trips import NEED, SECONDS
from skyway.planner.kernels.memory import Floats, Longs
from skyway.planner.pad_book import booked_until_ms
from skyway.scheduling.stays import Slot

#: The largest fleets whose best order is proven. Our own choice: with more, a proof takes minutes.
_MOST_DRONES: Final = 4
_MOST_REQUESTS: Final = 8


def is_small(problem: FleetProblem) -> bool:
    """Whether the rows of this fleet are few enough to look at each set of requests.

    If a model flies faster with a load, a later trip may serve a request sooner, and the bounds are
    not valid.
    """
    return (
        len(problem.drones) <= _MOST_DRONES
        and len(problem.requests) <= _MOST_REQUESTS
        and problem.has_slow_loads
    )


class RowBounds:
    """Least costs of the drones of a small fleet for each set of requests.

    Parameters
    ----------
    kinds
        The number of each drone's model, as `estimates` counts them.
    pools
        All sets of requests that may share a trip, single requests too.
    latest_s
        The latest delivery of requests with a promise.
    """

    def __init__(
        self,
        problem: FleetProblem,
        estimates: Estimates,
        *,
        kinds: Sequence[int],
        pools: Sequence[Pool],
        latest_s: Mapping[int, float] = MappingProxyType({}),
    ) -> None:
        requests = problem.requests
        numbers = np.arange(len(requests))
        self._estimates = estimates
        #: ``(sets, requests)``: whether the request belongs to the set.
        self.members = (np.arange(1 << len(requests))[:, None] >> numbers & 1).astype(np.float64)
        unserved_s = [each.weight * (problem.prices.unserved_s - each.known_s) for each in requests]
        #: ``(sets,)``: the cost if all requests of the set are unserved.
        self.unserved_s: Floats = self.members @ unserved_s
        latest = np.array([latest_s.get(each, math.inf) for each in range(len(requests))])
        self._tasks = [
            _task(problem, estimates, kind, pools, latest) for kind in range(len(estimates.models))
        ]
        ends = max(len(each.ends) for each in self._tasks)
        self._label = np.empty((len(self.members), ends, MOST_LABELS, 4))
        self._count = np.empty((len(self.members), ends), np.int64)
        self._found: dict[tuple[int, Slot], tuple[int, Floats]] = {}
        self._starts = [
            (kind, Slot(each.station_id, booked_until_ms(each.free_s), each.soc))
            for kind, each in zip(kinds, problem.drones, strict=True)
        ]
        # Each request earns what it costs at least. So a row that costs more than all other
        # requests leave of a good schedule is left out while it is short.
        first_s = first_costs_s(problem, estimates, kinds)
        for each in self._tasks:
            each.nodes.price[:] = first_s
        self._first_s: Floats = self.members @ first_s

    def of(self, kind: int, slot: Slot, left: int, *, most_s: float) -> Floats:
        """The least cost of each set in `left` for a drone of this model from this slot on.

        ``(sets,)``; inf for a set that it cannot serve, or only in a schedule that costs more than
        `most_s`.
        """
        known, least = self._found.get((kind, slot), (0, self._first_s))
        if left & ~known or not known:
            left |= known
            least = self._least(kind, slot, left, most_s - self._first_s[-1]) + self._first_s
            self._found[kind, slot] = left, least
        return least

    def fleet_s(self) -> float:
        """The least cost of all requests, in every plan of the fleet."""
        every = len(self.members) - 1
        rows = (self.of(*each, every, most_s=math.inf) for each in self._starts)
        return float(
            reduce(lambda one, row: shared_out(one, row, every), rows, self.unserved_s)[-1]
        )

    def _least(self, kind: int, slot: Slot, left: int, most: float) -> Floats:
        """The least cost of each set in `left`, less what its requests earn, ``(sets,)``."""
        least = np.empty(len(self.members))
        place, free_s = self._estimates.place_of[slot.station_id], slot.at_ms / 1000
        charged_s = free_s - self._estimates.credit_s(kind, slot.soc)
        task, room = self._tasks[kind], (self._label, self._count)
        least_rows(task, place, free_s, charged_s, left, most, *room, least)
        return least


def first_costs_s(problem: FleetProblem, estimates: Estimates, kinds: Sequence[int]) -> Floats:
    """The least cost of each request if the whole fleet served it alone, or left it unserved.

    Each request is picked up where that is best for it, because a shared trip may begin there.
    Energy and lateness do not count. ``(requests,)``.
    """
    found = []
    for number, request in enumerate(problem.requests):
        first_s = min(
            drone.free_s
            + estimates.least_s_from(
                pickup, kind, (number,), start=Slot(drone.station_id, 0, drone.soc)
            )
            for drone, kind in zip(problem.drones, kinds, strict=True)
            for pickup in (request.source, *request.pickups)
        )
        waited_s = problem.prices.delivery * (first_s - request.known_s)
        unserved_s = problem.prices.unserved_s - request.known_s
        found.append(request.weight * min(waited_s, unserved_s))
    return np.array(found)


def _task(
    problem: FleetProblem,
    estimates: Estimates,
    kind: int,
    pools: Sequence[Pool],
    latest_s: Floats,
) -> RowTask:
    """The trips of one model as arrays."""
    sources = sources_of(problem, estimates)
    nodes, ready_s = nodes_of(problem, estimates, kind, pools, sources)
    ends, end = np.unique(nodes.end, return_inverse=True)
    detour = estimates.detour(kind)
    has_no_pad = detour[nodes.end, nodes.end, SECONDS] > 0
    return RowTask(
        nodes=nodes,
        approach=estimates.approach(kind),
        detour=detour,
        sources=sources,
        bits=np.where(nodes.member < 0, 0, 1 << np.maximum(nodes.member, 0)).sum(axis=1),
        end=end,
        delay=problem.prices.delivery * _weight_at_end(nodes) * has_no_pad,
        ready_s=ready_s,
        ends=ends,
        latest_s=latest_s,
    )


def _weight_at_end(nodes: Nodes) -> Floats:
    """The weight of the requests that each node serves with its last hand-over, ``(nodes,)``."""
    need_s = np.where(nodes.member < 0, -math.inf, nodes.served[:, :, NEED])
    is_last = need_s >= need_s.max(axis=1, initial=-math.inf, keepdims=True)
    weight = np.where(is_last & (nodes.member >= 0), nodes.weight[nodes.member], 0.0)
    found: Floats = weight.sum(axis=1)
    return found


@cache
def parts_of(whole: int) -> tuple[Longs, Longs, Longs, Longs]:
    """All sets in `whole`; for each of them all parts of it, the rests, and where they begin."""
    sets = [each for each in range(whole + 1) if not each & ~whole]
    by_set = [[part for part in sets if not part & ~each] for each in sets]
    counts = [len(each) for each in by_set]
    parts = np.concatenate([np.array(each, np.int64) for each in by_set])
    first = np.cumsum([0, *counts[:-1]])
    return np.array(sets), parts, np.repeat(sets, counts) ^ parts, first


def shared_out(one: Floats, other: Floats, whole: int) -> Floats:
    """The least cost of each set in `whole` if two share it out, ``(sets,)``; else inf."""
    sets, parts, rests, first = parts_of(whole)
    found = np.full(len(one), np.inf)
    found[sets] = np.minimum.reduceat(one[parts] + other[rests], first)
    return found


def least_shared_out(one: Floats, other: Floats, whole: int) -> float:
    """The least cost of this set if two share it out."""
    _, parts, _, first = parts_of(whole)
    own = parts[first[-1] :]
    return float((one[own] + other[whole ^ own]).min())
