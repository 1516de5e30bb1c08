"""What the trips that are left cost at least, for each set of requests, by estimates.

A set of requests is a number whose bit r says that request r belongs to it.
"""

from collections.abc import Sequence
from functools import cache

import numpy as np

from skyway.dispatch.estimates import Estimates
from skyway.dispatch.planned_trip import Pool
from skyway.dispatch.problem import FleetProblem
from skyway.planner.kernels.fleet_trips import NEED
from skyway.planner.kernels.memory import Floats, Longs
from skyway.scheduling.stays import Slot


class RowBounds:
    """Least costs of one drone that serves a set of requests, without lateness and energy."""

    def __init__(self, problem: FleetProblem, estimates: Estimates, pools: Sequence[Pool]) -> None:
        requests = problem.requests
        self._estimates = estimates
        #: ``(sets, requests)``: whether the request belongs to the set.
        self.members = np.array(
            [
                [each >> number & 1 for number in range(len(requests))]
                for each in range(1 << len(requests))
            ],
            np.float64,
        )
        weight = np.array([problem.prices.delivery * each.weight for each in requests])
        known_s = np.array([each.known_s for each in requests])
        self._weight = self.members @ weight
        self._known = self.members @ (weight * known_s)
        self._least = [
            _least(self._weight, weight, problem.hand_over_s, estimates, kind, pools)
            for kind in range(len(estimates.models))
        ]

    def of(self, kind: int, slot: Slot) -> Floats:
        """The least cost of each set for a drone of this model from this slot on, ``(sets,)``."""
        place = self._estimates.place_of[slot.station_id]
        free_s = slot.at_ms / 1000
        starts_s = np.array([[free_s], [free_s - self._estimates.credit_s(kind, slot.soc)]])
        costs = self._least[kind][:, :, place] + starts_s * self._weight - self._known
        found: Floats = costs.max(axis=0)
        return found


def _least(
    weight_of: Floats,
    weight: Floats,
    hand_over_s: float,
    estimates: Estimates,
    kind: int,
    pools: Sequence[Pool],
) -> Floats:
    """Weighted seconds to serve each set from each place on, ``(2, sets, places)``.

    The first axis counts the flights only, and the needs.
    """
    approach = estimates.approach(kind)[:, :, : NEED + 1].transpose(2, 1, 0)
    bits, source, end, after, served = [], [], [], [], []
    for pool in pools:
        for at in estimates.pickups(pool):
            trip = estimates.trip_from(at, kind, pool)
            alone = [estimates.trip_from(at, kind, (one,)).least.min(axis=0) for one in pool]
            in_pool = sum(weight[one] * each for one, each in zip(pool, alone, strict=True))
            for place, least in zip(trip.ends.tolist(), trip.least, strict=True):
                bits.append(sum(1 << one for one in pool))
                source.append(estimates.place_of[at])
                end.append(place)
                after.append(least[: NEED + 1] + hand_over_s)
                served.append(in_pool[: NEED + 1])
    bits_of, source_of, end_of = np.array(bits), np.array(source), np.array(end)
    after_of, served_of = np.array(after).T, np.array(served).T
    found = np.zeros((NEED + 1, len(weight_of), approach.shape[2]))
    for each in range(1, len(weight_of)):
        here = np.flatnonzero(bits_of & ~each == 0)
        rest = each ^ bits_of[here]
        costs = served_of[:, here] + weight_of[rest] * after_of[:, here]
        costs += found[:, rest, end_of[here]]
        flown = weight_of[each] * approach[:, source_of[here]]
        found[:, each] = (costs[:, :, None] + flown).min(axis=1)
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
