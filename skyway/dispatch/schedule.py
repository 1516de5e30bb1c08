"""A schedule: the trips of all drones, planned one after another around the pads of earlier trips.

`Sequences` say which drone flies which requests in which order; `Scheduler` plans them.
"""

import heapq
import math
from collections.abc import Iterable
from dataclasses import dataclass

from skyway.dispatch.estimates import Estimates
from skyway.dispatch.objective import Costs, Pricing
from skyway.dispatch.order_moves import Order
from skyway.dispatch.pads import HeldPad
from skyway.dispatch.planned_trip import DroneTrip, NotPlanned, PlannedTrip, Pool
from skyway.dispatch.pools import planned_trips
from skyway.dispatch.problem import FleetProblem
from skyway.dispatch.trips import TripPlanner
from skyway.ids import StationId
from skyway.planner.kernels.memory import Longs
from skyway.planner.pad_book import booked_until_ms
from skyway.scheduling.stays import Slot

#: For each drone its trips in order, and for each trip the requests that share it.
Sequences = tuple[tuple[Pool, ...], ...]


@dataclass(frozen=True, slots=True)
class Schedule:
    """Trips in the order in which they were planned, and what they cost."""

    trips: tuple[DroneTrip, ...]
    unserved: dict[int, NotPlanned]
    costs: Costs

    @property
    def order(self) -> Order:
        """The drone and the requests of each trip, in the order in which they were planned."""
        return tuple((each.drone, each.trip.pool) for each in self.trips)

    def sequences(self, drones: int) -> Sequences:
        """The requests of each drone's trips in order."""
        found: list[list[Pool]] = [[] for _ in range(drones)]
        for each in self.trips:
            found[each.drone].append(each.trip.pool)
        return tuple(map(tuple, found))


class Calendar:
    """The trips planned so far: where each drone is free, and which pads are held.

    `add_next` takes over the next trip of `like` if the trips before it are the same, in any order.
    """

    def __init__(
        self, planner: TripPlanner, estimates: Estimates, like: Schedule | None = None
    ) -> None:
        problem = planner.problem
        self._estimates = estimates
        self._planner = planner
        self._hand_over_ms = booked_until_ms(problem.hand_over_s)
        self.slots = [
            Slot(each.station_id, booked_until_ms(each.free_s), each.soc) for each in problem.drones
        ]
        planner.begin()
        self._pads = planner.given.copy()
        self._new_pads: list[HeldPad] = []
        self.trips: list[DroneTrip] = []
        self._like = () if like is None else like.trips
        #: The trips that only one of the two has among its first trips.
        self._other: set[DroneTrip | None] = set()

    def plan(self, pool: Pool, drone: int) -> PlannedTrip | None:
        """The trip of this drone after its trips so far, not added yet; None if it has no plan."""
        return self._planner.plan(pool, drone, self.slots[drone], self._pads, self._new_pads)

    def foresee(self, pools: Iterable[Pool], drone: int) -> None:
        """Plan these trips of this drone as if every pad were free, so that `plan` is faster."""
        self._planner.foresee(pools, drone, self.slots[drone])

    def has_room(self, trip: PlannedTrip | None) -> bool:
        """Whether the pads of this trip are free; True if there is no trip."""
        return trip is None or self._pads.fitted(trip.pads) == trip.pads

    def add_next(self, pool: Pool, drone: int) -> PlannedTrip | None:
        """Add the next trip of this drone, which serves these requests; None if it has no plan."""
        number = len(self.trips)
        like = self._like[number] if number < len(self._like) else None
        if like is not None and not self._other and (like.drone, like.trip.pool) == (drone, pool):
            self.add(like.trip, drone)
            return like.trip
        trip = self.plan(pool, drone)
        if trip is not None:
            self.add(trip, drone)
            if like != self.trips[-1]:
                self._other ^= {like, self.trips[-1]}
        return trip

    def add_where_first(self, pool: Pool) -> NotPlanned | None:
        """Add the trip of the drone that delivers earliest; the reason if no drone has a trip.

        If two trips deliver at the same moment, the trip that uses less energy is added. A drone is
        not planned if its estimate ends later than the best trip so far.
        """
        best: tuple[tuple[int, float, int], PlannedTrip] | None = None
        for least_ms, drone in sorted(
            (self._soonest_ms(pool, drone), drone) for drone in range(len(self.slots))
        ):
            if best is not None and least_ms > best[0][0]:
                break
            trip = self.plan(pool, drone)
            if trip is None:
                continue
            key = (trip.end.at_ms, trip.energy_j, drone)
            if best is None or key < best[0]:
                best = key, trip
        if best is None:
            return self._planner.reason(pool, 0, self.slots[0], self._pads)
        self.add(best[1], best[0][2])
        return None

    def _soonest_ms(self, pool: Pool, drone: int) -> float:
        """The moment before which no trip of this drone ends."""
        return min(self.least_end_ms(pool, drone, each) for each in self._estimates.pickups(pool))

    def least_end_ms(self, pool: Pool, drone: int, pickup: StationId) -> float:
        """The moment before which no trip of this drone ends that is loaded at this pickup."""
        kind, slot = self._planner.model_of[drone], self.slots[drone]
        return slot.at_ms + 1000 * self._estimates.least_s_from(pickup, kind, pool, start=slot)

    def kind_and_slot(self, drone: int) -> tuple[int, Slot]:
        """The number of this drone's model, and where the drone is free."""
        return self._planner.model_of[drone], self.slots[drone]

    def after(self, added: DroneTrip) -> tuple[int, Slot]:
        """The number of the drone's model, and where the drone is free after this trip."""
        end = added.trip.end
        slot = Slot(end.station_id, end.at_ms + self._hand_over_ms, end.soc)
        return self._planner.model_of[added.drone], slot

    def add(self, trip: PlannedTrip, drone: int) -> None:
        """Add a trip that was planned by `plan`."""
        _, self.slots[drone] = self.after(DroneTrip(drone, trip))
        self._pads.hold(trip.pads)
        self._new_pads += trip.pads
        self.trips.append(DroneTrip(drone, trip))


class Scheduler:
    """Makes schedules of one fleet problem."""

    def __init__(self, problem: FleetProblem) -> None:
        self.problem = problem
        self.planner = TripPlanner(problem)
        self.estimates = Estimates(
            problem,
            self.planner.models,
            sharing=self.planner.sharing,
            may_fly=self.planner.may_fly,
        )
        self.pricing = Pricing(problem)

    def arrival_order(self) -> Schedule:
        """The schedule that books the requests in the order in which they came.

        Each request gets the drone that delivers it first; if two are equal, the drone that uses
        less energy.
        """
        calendar = Calendar(self.planner, self.estimates)
        unserved = self._added(calendar, range(len(self.problem.requests)))
        return self.priced(calendar.trips, unserved)

    def alone_s(self, number: int) -> float:
        """When this request is served if the fleet has no other request; inf if never."""
        calendar = Calendar(self.planner, self.estimates)
        if calendar.add_where_first((number,)) is not None:
            return math.inf
        return calendar.trips[0].trip.end.at_ms / 1000

    def planned(
        self,
        sequences: Sequences,
        *,
        leads_ms: Longs | None = None,
        like: Schedule | None = None,
    ) -> Schedule:
        """The schedule of these sequences; the drone that is free first is planned next.

        Requests that are missing, or that have no plan at their place in the sequence, are added
        at the end as in the arrival order. The first trips of `like` are taken over as far as they
        are planned in the same order.

        Parameters
        ----------
        leads_ms
            ``(requests,)``, milliseconds: a trip is planned as if its drone were free so much
            sooner. The first request of a shared trip counts.
        """
        calendar = Calendar(self.planner, self.estimates, like)
        leads = [0] * len(self.problem.requests) if leads_ms is None else leads_ms.tolist()
        missing = set(range(len(leads)))
        following = [iter(each) for each in sequences]
        waiting: list[tuple[int, int, Pool]] = []

        def wait(drone: int) -> None:
            pool = next(following[drone], None)
            if pool is not None:
                moment_ms = calendar.slots[drone].at_ms - leads[pool[0]]
                heapq.heappush(waiting, (moment_ms, drone, pool))

        for drone in range(len(sequences)):
            wait(drone)
        while waiting:
            _, drone, pool = heapq.heappop(waiting)
            if calendar.add_next(pool, drone) is not None:
                missing.difference_update(pool)
            wait(drone)
        return self.priced(calendar.trips, self._added(calendar, missing))

    def in_order(self, order: Order, *, like: Schedule | None = None) -> Schedule:
        """The schedule whose trips are planned in this order.

        Requests that are missing or have no plan are added at the end as in the arrival order. The
        first trips of `like` are taken over as far as the order is the same.
        """
        calendar = Calendar(self.planner, self.estimates, like)
        for drone, pool in order:
            calendar.add_next(pool, drone)
        missing = set(range(len(self.problem.requests)))
        missing.difference_update(number for each in calendar.trips for number in each.trip.pool)
        return self.priced(calendar.trips, self._added(calendar, missing))

    def current(self) -> Schedule | None:
        """The schedule of the current plan with all other requests added; None without a plan.

        Requests that may not share a trip follow one another.
        """
        numbers = {each.drone_id: number for number, each in enumerate(self.problem.drones)}
        planned = planned_trips(self.problem)
        trips = {
            (numbers[drone_id], start_s): pool
            for (drone_id, start_s), pool in planned.items()
            if drone_id in numbers
        }
        if not trips:
            return None
        found: list[list[Pool]] = [[] for _ in numbers]
        for (drone, _), pool in sorted(trips.items()):
            is_allowed = self.planner.sharing.allows(pool)
            found[drone] += [pool] if is_allowed else [(each,) for each in pool]
        return self.planned(tuple(map(tuple, found)))

    def priced(self, trips: Iterable[DroneTrip], unserved: dict[int, NotPlanned]) -> Schedule:
        """The schedule of these trips, with its costs."""
        trips = tuple(trips)
        return Schedule(trips, unserved, self.pricing.costs(trips, unserved))

    def _added(self, calendar: Calendar, numbers: Iterable[int]) -> dict[int, NotPlanned]:
        """Add these requests in the order of arrival; returns the requests that have no trip."""
        requests = self.problem.requests
        unserved = {}
        for number in sorted(numbers, key=lambda one: (requests[one].known_s, one)):
            reason = calendar.add_where_first((number,))
            if reason is not None:
                unserved[number] = reason
        return unserved
