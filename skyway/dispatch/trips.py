"""Plans single trips of a fleet plan with the exact planner, around the pads that are held.

This is the one place of the dispatcher that calls the planner.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import timedelta
from typing import NamedTuple, Self

from skyway.delivery.plan import Deliver, Plan, Recharge
from skyway.dispatch.pads import HeldPad, PadLedger
from skyway.dispatch.problem import FleetProblem, FleetRequest
from skyway.ids import StationId
from skyway.planner.airspace import Airspace
from skyway.planner.compose import compose
from skyway.planner.hierarchy import Hierarchy
from skyway.planner.pad_book import NO_RESERVATIONS, PadBook, booked_from_ms, booked_until_ms
from skyway.planner.problem import DroneAtStart, Problem
from skyway.planner.problem_parts import PackageToDeliver
from skyway.scheduling.stays import Slot
from skyway.scheduling.trip import soc_after

#: Requests that share a trip, by their number in the problem, ascending.
Pool = tuple[int, ...]


class NotPlanned(NamedTuple):
    """Why there is no trip."""

    code: str
    detail: str


@dataclass(frozen=True, slots=True)
class PlannedTrip:
    """One trip of one drone; moments are milliseconds of the problem's time.

    `plan` counts from the slot. `delivered_ms` is by request, in the order of `pool`. `end` is
    where, when and with what charge the drone is free after its last hand-over. `pads` are the
    sessions of the plan, maybe on other pads of the same station.
    """

    pool: Pool
    slot: Slot
    plan: Plan
    delivered_ms: tuple[int, ...]
    end: Slot
    energy_j: float
    pads: tuple[HeldPad, ...]

    @classmethod
    def of(cls, pool: Pool, requests: Sequence[FleetRequest], *, slot: Slot, plan: Plan) -> Self:
        """The trip of a plan that can be flown."""
        delivered_s = {each.package_id: each.delivered_s for each in plan.deliveries}
        delivered_ms = tuple(
            slot.at_ms + booked_until_ms(max(delivered_s[one.package_id] for one in each.packages))
            for each in requests
        )
        last = [step.station_id for step in plan.steps if isinstance(step, Deliver)][-1]
        end_ms = slot.at_ms + booked_until_ms(plan.delivery_time_s or 0.0)
        pads = tuple(
            HeldPad(
                step.station_id,
                step.pad,
                slot.at_ms + booked_from_ms(step.start_s),
                slot.at_ms + booked_until_ms(step.end_s),
            )
            for step in plan.steps
            if isinstance(step, Recharge)
        )
        end = Slot(last, end_ms, soc_after(plan, slot.soc))
        return cls(pool, slot, plan, delivered_ms, end, plan.energy_j or 0.0, pads)

    def moved(self, slot: Slot, pads: tuple[HeldPad, ...]) -> Self:
        """The same trip from another moment on, on these pads."""
        by_ms = slot.at_ms - self.slot.at_ms
        return replace(
            self,
            slot=slot,
            delivered_ms=tuple(each + by_ms for each in self.delivered_ms),
            end=replace(self.end, at_ms=self.end.at_ms + by_ms),
            pads=pads,
        )

    def pads_at(self, slot: Slot) -> tuple[HeldPad, ...]:
        """Its sessions if the trip began at this slot."""
        by_ms = slot.at_ms - self.slot.at_ms
        if by_ms == 0:
            return self.pads
        return tuple(
            HeldPad(each.station_id, each.pad, each.start_ms + by_ms, each.end_ms + by_ms)
            for each in self.pads
        )

    @property
    def plan_on_pads(self) -> Plan:
        """The plan with the pads that the trip holds."""
        pads = iter(self.pads)
        steps = tuple(
            step.model_copy(update={"pad": next(pads).pad}) if isinstance(step, Recharge) else step
            for step in self.plan.steps
        )
        return self.plan.model_copy(update={"steps": steps})


class DroneTrip(NamedTuple):
    """A trip, and the number of the drone that flies it."""

    drone: int
    trip: PlannedTrip


class TripPlanner:
    """Plans trips of one fleet problem, and caches the plans that no held pad disturbs.

    A plan that is best with every pad free is also best among held pads, as long as its own
    sessions find pads. So most trips of a search come from the cache. Windows, closures, zones and
    opening hours make plans depend on their moment: then nothing is cached.
    """

    def __init__(self, problem: FleetProblem) -> None:
        self.problem = problem
        self._airspace = Airspace.of(problem.network)
        self._hierarchy = Hierarchy.of(problem.network)
        self._cached: dict[tuple[int, StationId, float, Pool], PlannedTrip | NotPlanned] = {}
        network = problem.network
        self._is_timeless = not (
            problem.closures
            or any(zone.active_from or zone.active_until for zone in network.zones)
            or network.opening_hours
            or any(each.has_windows for each in problem.requests)
        )
        #: The distinct models, and the number of each drone's model.
        self.models = [*dict.fromkeys(each.model for each in problem.drones)]
        self.model_of = [self.models.index(each.model) for each in problem.drones]
        #: How many times the planner was called.
        self.compositions = 0

    def plan(self, pool: Pool, drone: int, slot: Slot, pads: PadLedger) -> PlannedTrip | NotPlanned:
        """The trip that serves these requests from this slot on, and delivers earliest."""
        if self._is_timeless:
            undisturbed = self._undisturbed(pool, drone, slot)
            if isinstance(undisturbed, NotPlanned):
                return undisturbed
            fitted = pads.fitted(undisturbed.pads_at(slot))
            if fitted is not None:
                return undisturbed.moved(slot, fitted)
        return self._planned(pool, drone, slot, pads.book(from_ms=slot.at_ms))

    def _undisturbed(self, pool: Pool, drone: int, slot: Slot) -> PlannedTrip | NotPlanned:
        key = (self.model_of[drone], slot.station_id, slot.soc, pool)
        found = self._cached.get(key)
        if found is None:
            found = self._cached[key] = self._planned(pool, drone, slot, NO_RESERVATIONS)
        return found

    def _planned(
        self, pool: Pool, drone: int, slot: Slot, booked: PadBook
    ) -> PlannedTrip | NotPlanned:
        self.compositions += 1
        plan = compose(
            self.problem_of(pool, drone, slot),
            airspace=self._airspace,
            hierarchy=self._hierarchy,
            booked=booked.seen_from(slot.at_ms),
        )
        if not plan.is_flyable:
            why = plan.infeasibility
            if why is None:
                return NotPlanned("NO_PLAN_FOUND", "no plan was found within the label limit")
            return NotPlanned(why.code, why.detail)
        requests = [self.problem.requests[each] for each in pool]
        return PlannedTrip.of(pool, requests, slot=slot, plan=plan)

    def problem_of(self, pool: Pool, drone: int, slot: Slot) -> Problem:
        """The planner's problem of these requests from this slot on; held pads are not in it."""
        model = self.problem.drones[drone].model
        whole, since_s = self.problem, slot.at_ms / 1000
        requests = [whole.requests[each] for each in pool]
        start_at = whole.start_at
        return Problem(
            network=whole.network,
            start_at=None if start_at is None else start_at + timedelta(milliseconds=slot.at_ms),
            drone=DroneAtStart(model=model, soc=slot.soc, station_id=slot.station_id),
            source=requests[0].source,
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
            pickup_not_before_s=_moved(
                _last([each.pickup_not_before_s for each in requests]), since_s
            ),
            pickup_latest_s=_moved(_first([each.pickup_latest_s for each in requests]), since_s),
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


def _last(moments_s: Sequence[float | None]) -> float | None:
    return max((each for each in moments_s if each is not None), default=None)


def _first(moments_s: Sequence[float | None]) -> float | None:
    return min((each for each in moments_s if each is not None), default=None)
