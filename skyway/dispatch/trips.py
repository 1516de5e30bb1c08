"""Plans single trips of a fleet plan with the exact planner, around the pads that are held.

Only this file of the dispatcher calls the planner.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import timedelta
from types import MappingProxyType
from typing import Final, NamedTuple

import numpy as np

from skyway.dispatch.pads import FleetPads, HeldPad, Reserved
from skyway.dispatch.planned_trip import NotPlanned, PlannedTrip, Pool
from skyway.dispatch.pools import Sharing
from skyway.dispatch.problem import FleetProblem
from skyway.drone.cargo import misfit
from skyway.drone.model import DroneModel
from skyway.ids import StationId
from skyway.planner import PadLedger, Trips, TripTerms, compose, compose_many
from skyway.planner.pad_book import PadBook, booked_until_ms
from skyway.planner.planned_trips import PlannedTrips, TripOutcome
from skyway.planner.problem import DroneAtStart, Problem
from skyway.planner.problem_parts import PackageToDeliver
from skyway.scheduling.stays import Slot

#: The most trips around held pads that are cached; then the cache is emptied. Our own choice: with
#: 100 trips in a plan they are about 30 MB.
_MOST_CACHED: Final = 4_000


class _Ledgers(NamedTuple):
    """The ledgers for models that fit the same pads: without held pads, and with them.

    `kinds` are the numbers of these models.
    """

    kinds: Sequence[int]
    free: PadLedger
    held: PadLedger


def _ledgers(
    problem: FleetProblem, models: Sequence[DroneModel], book: PadBook
) -> Iterator[_Ledgers]:
    """The ledgers for each group of models that fit the same pads."""
    fitting = [id(problem.network.fitting(model.connector)) for model in models]
    for network in dict.fromkeys(fitting):
        kinds = [kind for kind, each in enumerate(fitting) if each == network]
        terms = TripTerms.of(
            problem.network,
            [models[kind] for kind in kinds],
            start_at=problem.start_at,
            closures=problem.closures,
            loading_s=problem.loading_s,
            dropoff_s=problem.dropoff_s,
        )
        yield _Ledgers(kinds, PadLedger(terms), PadLedger(terms, book))


class TripPlanner:
    """Plans trips of one fleet problem, and caches the plans that need no held pad.

    The best plan with every pad free is also the best plan among held pads if its own sessions find
    free pads. So most trips of a search come from the cache. With windows, closures, dated zones or
    opening hours a plan depends on its moment, so nothing is cached.
    """

    def __init__(self, problem: FleetProblem) -> None:
        self.problem = problem
        self.sharing = Sharing(problem)
        # If requests name providers, what a drone may fly depends on its provider too.
        is_limited = any(each.provider_ids is not None for each in problem.requests)
        kind_of = [(each.model, each.provider_id if is_limited else "") for each in problem.drones]
        kinds = [*dict.fromkeys(kind_of)]
        #: The distinct models, and the number of each drone's model.
        self.models = [model for model, _ in kinds]
        self.model_of = [kinds.index(each) for each in kind_of]
        self._provider_of = [provider_id for _, provider_id in kinds]
        self._may_misfit = any(
            one.needs_cargo_check for each in problem.requests for one in each.packages
        )
        self.given = FleetPads(problem)
        book = self.given.book()
        self._reserved = Reserved(book)
        self._ledgers = [*_ledgers(problem, self.models, book)]
        #: The ledgers of each model, and its number among the models of their terms.
        self._ledgers_of = [
            next((each, each.kinds.index(kind)) for each in self._ledgers if kind in each.kinds)
            for kind in range(len(self.models))
        ]
        self._latest_s: Mapping[int, float] = {}
        #: Whether no search for a trip has ended early for lack of labels.
        self.is_exact = True
        self._cached: dict[tuple[int, StationId, float, Pool], PlannedTrip | None] = {}
        #: Trips around these held pads.
        self._around: dict[tuple[int, Slot, Pool, frozenset[HeldPad]], PlannedTrip | None] = {}
        network = problem.network
        self._is_timeless = not (
            problem.closures
            or any(zone.active_from or zone.active_until for zone in network.zones)
            or network.opening_hours
            or any(each.has_windows for each in problem.requests)
        )

    def keep(self, latest_s: Mapping[int, float]) -> None:
        """Try to keep these latest deliveries of requests with a promise in shared trips."""
        self._latest_s = latest_s
        self._around.clear()

    def begin(self) -> None:
        """Release all pads that trips hold."""
        parts = np.array(self._reserved.parts, np.int64).reshape(-1, 4)
        for each in self._ledgers:
            each.held.release(parts)
        self._reserved.clear()

    def may_fly(self, kind: int, pool: Pool) -> bool:
        """Whether these drones may fly all these requests: by their provider and their cargo."""
        requests = [self.problem.requests[each] for each in pool]
        if self._may_misfit:
            packages = [one for each in requests for one in each.packages]
            if misfit(self.models[kind], packages) is not None:
                return False
        allowed = (each.provider_ids for each in requests)
        return all(each is None or self._provider_of[kind] in each for each in allowed)

    def plan(
        self, pool: Pool, drone: int, slot: Slot, pads: FleetPads, new: list[HeldPad]
    ) -> PlannedTrip | None:
        """The trip that serves these requests from this slot on, and delivers earliest.

        If a shared trip would break a promise, it is the earliest trip that keeps all promises.
        None if no plan exists or is found. `new` are the pads that are held since the last call;
        the list is empty afterwards.
        """
        if not self.may_fly(self.model_of[drone], pool):
            return None
        if self._is_timeless:
            undisturbed = self._undisturbed(pool, drone, slot)
            if undisturbed is None:
                return None
            fitted = pads.fitted(undisturbed.pads_at(slot))
            if fitted is not None:
                moved = undisturbed.moved(slot, fitted)
                if not self._breaks_promises(moved):
                    return moved
        key = (self.model_of[drone], slot, pool, pads.after(slot.at_ms))
        if key in self._around:
            return self._around[key]
        for session in new:
            parts = self._reserved.new_parts(pads.widened(session))
            for each in self._ledgers:
                each.held.reserve(parts)
        new.clear()
        ledgers, _ = self._ledgers_of[self.model_of[drone]]
        (trip,) = self._planned((pool,), drone, slot, ledgers.held)
        if trip is not None and self._breaks_promises(trip):
            (kept,) = self._planned((pool,), drone, slot, ledgers.held, latest_s=self._latest_s)
            trip = kept or trip
        if len(self._around) >= _MOST_CACHED:
            self._around.clear()
        self._around[key] = trip
        return trip

    def _breaks_promises(self, trip: PlannedTrip) -> bool:
        """Whether the requests share the trip, and one of them is delivered too late."""
        return len(trip.pool) > 1 and any(
            moment_ms / 1000 > self._latest_s.get(number, math.inf)
            for number, moment_ms in zip(trip.pool, trip.delivered_ms, strict=True)
        )

    def foresee(self, pools: Iterable[Pool], drone: int, slot: Slot) -> None:
        """Plan these trips as if every pad were free, in one call of the planner."""
        if not self._is_timeless:
            return
        kind = self.model_of[drone]
        keys = [(kind, slot.station_id, slot.soc, pool) for pool in pools]
        keys = [each for each in keys if each not in self._cached]
        if keys:
            ledgers, _ = self._ledgers_of[kind]
            trips = self._planned([pool for *_, pool in keys], drone, slot, ledgers.free)
            self._cached.update(zip(keys, trips, strict=True))

    def _undisturbed(self, pool: Pool, drone: int, slot: Slot) -> PlannedTrip | None:
        self.foresee((pool,), drone, slot)
        return self._cached[self.model_of[drone], slot.station_id, slot.soc, pool]

    def _planned(
        self,
        pools: Sequence[Pool],
        drone: int,
        slot: Slot,
        ledger: PadLedger,
        *,
        latest_s: Mapping[int, float] = MappingProxyType({}),
    ) -> list[PlannedTrip | None]:
        """For each pool the trip that keeps `latest_s` and ends first, from any tried pickup.

        If two end together, that with less energy. None if none is found.
        """
        loaded = [(at, pool) for pool in pools for at in self.sharing.pickups(pool)]
        columns = self._columns(loaded, drone, slot, latest_s)
        found = compose_many(columns, ledger, labels_per_trip=self.problem.label_limit)
        trips: dict[Pool, list[PlannedTrip]] = {pool: [] for pool in pools}
        for number, (_, pool) in enumerate(loaded):
            outcome = found.outcome[number]
            self.is_exact &= outcome not in (TripOutcome.FEASIBLE, TripOutcome.UNKNOWN)
            if found.is_planned[number]:
                trips[pool].append(self._trip_of(found, number, pool, drone, slot))
        return [
            min(trips[pool], key=lambda each: (each.end.at_ms, each.energy_j), default=None)
            for pool in pools
        ]

    def _trip_of(
        self, found: PlannedTrips, row: int, pool: Pool, drone: int, slot: Slot
    ) -> PlannedTrip:
        """The trip in this row of planned trips."""
        ids = self.problem.network.columns.station_ids
        first = int(found.trips.package_offsets[row])
        delivered_ms = []
        for number in pool:
            last = first + len(self.problem.requests[number].packages)
            delivered_ms.append(booked_until_ms(float(found.delivered_s[first:last].max())))
            first = last
        model = self.problem.drones[drone].model
        # Sums in another order than in the plan's steps may end a rounding error below the reserve.
        soc = max(model.reserve_soc, float(found.end_soc[row]))
        end = Slot(ids[int(found.end_row[row])], booked_until_ms(float(found.end_s[row])), soc)
        pads = tuple(
            HeldPad(ids[station], pad, from_ms, until_ms)
            for station, pad, from_ms, until_ms in found.sessions(row).tolist()
        )
        energy_j = float(found.energy_j[row])
        return PlannedTrip(pool, slot, tuple(delivered_ms), end, energy_j, pads, found, row)

    def _columns(
        self,
        loaded: Sequence[tuple[StationId, Pool]],
        drone: int,
        slot: Slot,
        until_s: Mapping[int, float],
    ) -> Trips:
        """The trips of these pickups and pools as the planner's columns."""
        row_of = self.problem.network.row_of
        pools = [[self.problem.requests[each] for each in pool] for _, pool in loaded]
        packages = [[one for each in pool for one in each.packages] for pool in pools]
        each_package = [one for each in packages for one in each]
        latest_of = [
            min(until_s.get(number, math.inf), math.inf if one.latest_s is None else one.latest_s)
            for _, pool in loaded
            for number in pool
            for one in self.problem.requests[number].packages
        ]
        return Trips.of(
            start_row=row_of[slot.station_id],
            start_s=slot.at_ms / 1000,
            soc=slot.soc,
            model=self._ledgers_of[self.model_of[drone]][1],
            source_row=[row_of[source] for source, _ in loaded],
            pickup_not_before_s=[_last(one.pickup_not_before_s for one in each) for each in pools],
            pickup_latest_s=[_first(one.pickup_latest_s for one in each) for each in pools],
            package_offsets=np.cumsum([0, *map(len, packages)]),
            destination_row=[row_of[each.destination] for each in each_package],
            mass_kg=[each.mass_kg for each in each_package],
            not_before_s=[
                -math.inf if each.not_before_s is None else each.not_before_s
                for each in each_package
            ],
            latest_s=latest_of,
        )

    def reason(self, pool: Pool, drone: int, slot: Slot, pads: FleetPads) -> NotPlanned:
        """Why this drone has no trip for these requests from this slot on."""
        booked = pads.book().seen_from(slot.at_ms)
        plan = compose(self.problem_of(pool, drone, slot), booked=booked)
        if plan.infeasibility is None:
            return NotPlanned("NO_PLAN_FOUND", "no plan was found within the label limit")
        return NotPlanned(plan.infeasibility.code, plan.infeasibility.detail)

    def problem_of(
        self, pool: Pool, drone: int, slot: Slot, *, source: StationId | None = None
    ) -> Problem:
        """The planner's problem of these requests from this slot on, without held pads.

        They are picked up at `source`; without it, at the source of the first request.
        """
        model = self.problem.drones[drone].model
        whole, since_s = self.problem, slot.at_ms / 1000
        requests = [whole.requests[each] for each in pool]
        start_at = whole.start_at
        return Problem(
            network=whole.network,
            start_at=None if start_at is None else start_at + timedelta(milliseconds=slot.at_ms),
            drone=DroneAtStart(model=model, soc=slot.soc, station_id=slot.station_id),
            source=requests[0].source if source is None else source,
            packages=tuple(_since(one, since_s) for each in requests for one in each.packages),
            closures=tuple(
                one.model_copy(
                    update={
                        "start_s": one.start_s - since_s,
                        "end_s": _moved(one.end_s, since_s),
                    }
                )
                for one in whole.closures
            ),
            loading_s=whole.loading_s,
            dropoff_s=whole.dropoff_s,
            pickup_not_before_s=_bound(
                _last(each.pickup_not_before_s for each in requests) - since_s
            ),
            pickup_latest_s=_bound(_first(each.pickup_latest_s for each in requests) - since_s),
            label_limit=whole.label_limit,
        )


def _since(package: PackageToDeliver, since_s: float) -> PackageToDeliver:
    """The package with its window counted from this moment."""
    if package.not_before_s is None and package.latest_s is None:
        return package
    return package.model_copy(
        update={
            "not_before_s": _moved(package.not_before_s, since_s),
            "latest_s": _moved(package.latest_s, since_s),
        }
    )


def _moved(moment_s: float | None, since_s: float) -> float | None:
    return None if moment_s is None else moment_s - since_s


def _last(moments_s: Iterable[float | None]) -> float:
    return max((each for each in moments_s if each is not None), default=-math.inf)


def _first(moments_s: Iterable[float | None]) -> float:
    return min((each for each in moments_s if each is not None), default=math.inf)


def _bound(moment_s: float) -> float | None:
    return moment_s if math.isfinite(moment_s) else None
