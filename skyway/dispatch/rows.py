"""A fleet problem and its sequences as the arrays that the kernels read."""

import math
from collections.abc import Iterable, Sequence
from typing import Final

import numpy as np
from numpy.random import Generator

from skyway.dispatch.estimates import Estimates
from skyway.dispatch.objective import J_PER_KWH, Limits
from skyway.dispatch.planned_trip import Pool
from skyway.dispatch.pools import SharedPools
from skyway.dispatch.problem import FleetProblem, FleetRequest
from skyway.dispatch.schedule import Sequences
from skyway.planner.kernels.fleet_costs import KEY_BITS
from skyway.planner.kernels.fleet_order import price_rows
from skyway.planner.kernels.fleet_records import FleetEstimates, Rows
from skyway.planner.kernels.memory import Floats

#: The price of a second after a latest moment. It is so high that no order gains by being late.
_NEVER_LATE = 1e4

#: The price of each request that a provider has to fly for fairness and does not fly, seconds.
_NEVER_UNFAIR = 1e6

#: About the share by which estimates vary. Our own choice.
_VARIED: Final = 0.02


class Board:
    """The pools of a problem by number, and sequences as rows of these numbers."""

    def __init__(
        self,
        problem: FleetProblem,
        estimates: Estimates,
        *,
        kinds: Sequence[int],
        shared: SharedPools,
    ) -> None:
        alone = ((each,) for each in range(len(problem.requests)))
        self.pools: list[Pool] = [*alone, *shared.pools]
        self.has_all_pools = shared.is_complete
        self.number_of = {pool: number for number, pool in enumerate(self.pools)}
        self.fleet = _fleet(problem, estimates, kinds, self.pools)
        self._flight = self.fleet.flight
        self._estimates = estimates
        self._providers = [*dict.fromkeys(each.provider_id for each in problem.drones)]
        self._drones = len(problem.drones)
        self._most = len(problem.requests) + 1

    def limit(self, limits: Limits) -> None:
        """Let the kernels keep these limits too, as far as the estimates show them."""
        latest_s = self.fleet.latest_s.copy()
        for number, moment_s in limits.latest_s.items():
            latest_s[number] = min(latest_s[number], moment_s)
        if np.isfinite(latest_s).any():
            self._soften()
        least_flown = [limits.flown.get(each, 0) for each in self._providers]
        self.fleet = self.fleet._replace(
            latest_s=latest_s, least_flown=np.array(least_flown, np.int64)
        )

    def _soften(self) -> None:
        """Let shared trips break limits as long as some order of their stops might keep them."""
        soonest = self.fleet.soonest
        for kind in range(len(soonest)):
            for number, pool in enumerate(self.pools):
                if len(pool) > 1:
                    soonest[kind, number, : len(pool)] = self._estimates.soonest(kind, pool)

    def harden(self, pools: Iterable[Pool]) -> None:
        """Judge these shared trips by the order of least need: no other order keeps the limits."""
        for each in pools:
            number = self.number_of[each]
            self.fleet.soonest[:, number] = _by_least_need(self.fleet, number)

    @property
    def has_shared(self) -> bool:
        """Whether requests may share trips."""
        return len(self.pools) > self._most - 1

    def vary(self, draws: Generator) -> None:
        """Let each trip take a little more or less time than estimated, by chance.

        Then annealing ends at another order, though it begins at the same one.
        """
        by = np.exp(_VARIED * draws.standard_normal((1, len(self.pools), 1)))
        self.fleet = self.fleet._replace(flight=self._flight * by)

    def rows(self, sequences: Sequences) -> Rows:
        """The rows of these sequences, priced."""
        pool = np.zeros((self._drones, self._most), np.int64)
        length = np.array([len(each) for each in sequences], np.int64)
        for drone, trips in enumerate(sequences):
            pool[drone, : len(trips)] = [self.number_of[each] for each in trips]
        rows = Rows(pool, length, np.zeros(self._drones))
        price_rows(self.fleet, rows)
        return rows

    def sequences(self, rows: Rows) -> Sequences:
        """The sequences of these rows."""
        return tuple(
            tuple(self.pools[each] for each in row[:length])
            for row, length in zip(rows.pool.tolist(), rows.length.tolist(), strict=True)
        )


def _by_least_need(fleet: FleetEstimates, pool: int) -> Floats:
    """Seconds and need until each member is served in the order of least need, by model."""
    return fleet.flight[:, pool, None, :2] - fleet.early_s[:, pool, :, None]


def _key(pool: Pool) -> int:
    """The same key as `key_of` of the kernels."""
    key = 0
    for member in pool:
        key = key << KEY_BITS | member + 1
    return key


def _window_end_s(request: FleetRequest) -> float:
    """The latest end of the windows of its hand-overs; inf if a hand-over has no window."""
    ends_s = [math.inf if each.latest_s is None else each.latest_s for each in request.packages]
    return max(ends_s)


def _fleet(
    problem: FleetProblem, estimates: Estimates, kinds: Sequence[int], pools: Sequence[Pool]
) -> FleetEstimates:
    drones, requests, prices = problem.drones, problem.requests, problem.prices
    members = np.full((len(pools), max(map(len, pools), default=1)), -1, np.int64)
    for number, pool in enumerate(pools):
        members[number, : len(pool)] = pool
    count = max(kinds) + 1
    flight, end = np.zeros((count, len(pools), 3)), np.zeros((count, len(pools)), np.int64)
    early_s = np.zeros((count, *members.shape))
    for kind in range(count):
        for number, pool in enumerate(pools):
            trip = estimates.trip(kind, pool)
            flight[kind, number], end[kind, number] = trip.best, trip.best_end
            early_s[kind, number, : len(pool)] = trip.early_s
    keys = np.array([_key(each) for each in pools], np.int64)
    order = np.argsort(keys)
    drone_number = {each.drone_id: number for number, each in enumerate(drones)}
    place_of = estimates.place_of
    providers = [*dict.fromkeys(each.provider_id for each in drones)]
    return FleetEstimates(
        kind=np.array(kinds, np.int64),
        start=np.array([place_of[each.station_id] for each in drones], np.int64),
        free_s=np.array([each.free_s for each in drones]),
        credit_s=np.array(
            [estimates.credit_s(kind, each.soc) for each, kind in zip(drones, kinds, strict=True)]
        ),
        approach=np.stack([estimates.approach(kind) for kind in range(count)]),
        flight=flight,
        end=end,
        early_s=early_s,
        soonest=flight[:, :, None, :2] - early_s[..., None],
        source=np.array([place_of[estimates.source(each)] for each in pools], np.int64),
        members=members,
        key=keys[order],
        pool_of_key=order.astype(np.int64),
        weight=np.array([each.weight for each in requests]),
        known_s=np.array([each.known_s for each in requests]),
        ready_s=np.array(
            [
                -math.inf if each.pickup_not_before_s is None else each.pickup_not_before_s
                for each in requests
            ]
        ),
        due_s=np.array([math.inf if each.due_s is None else each.due_s for each in requests]),
        latest_s=np.array([_window_end_s(each) for each in requests]),
        planned=np.array(
            [
                -1 if each.planned is None else drone_number.get(each.planned.drone_id, -1)
                for each in requests
            ],
            np.int64,
        ),
        provider=np.array([providers.index(each.provider_id) for each in drones], np.int64),
        least_flown=np.zeros(len(providers), np.int64),
        prices=np.array(
            [
                prices.delivery,
                prices.lateness,
                prices.energy_s_per_kwh / J_PER_KWH,
                prices.move_s,
                _NEVER_LATE,
                _NEVER_UNFAIR,
            ]
        ),
        hand_over_s=problem.hand_over_s,
    )
