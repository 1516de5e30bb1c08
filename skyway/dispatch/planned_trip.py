"""A planned trip of a fleet plan, and why a request has none."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple, Self

from skyway.delivery.plan import Deliver, PickUp, Plan, Recharge, Step
from skyway.dispatch.pads import HeldPad
from skyway.dispatch.problem import FleetRequest
from skyway.ids import PackageId
from skyway.planner.pad_book import booked_from_ms, booked_until_ms
from skyway.planner.planned_trips import PlannedTrips
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

    `delivered_ms` is by request, in the order of `pool`. `end` is where, when and with what charge
    the drone is free after its last hand-over. `pads` are the sessions of the plan; a session may
    have moved to another pad of its station. Row `row` of `found` makes the plan.
    """

    pool: Pool
    slot: Slot
    delivered_ms: tuple[int, ...]
    end: Slot
    energy_j: float
    pads: tuple[HeldPad, ...]
    found: PlannedTrips | None = field(default=None, compare=False)
    row: int = field(default=0, compare=False)

    @classmethod
    def of(cls, pool: Pool, requests: Sequence[FleetRequest], *, slot: Slot, plan: Plan) -> Self:
        """The trip of a plan whose seconds count from the slot."""
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
        return cls(pool, slot, delivered_ms, end, plan.energy_j or 0.0, pads)

    def moved(self, slot: Slot, pads: tuple[HeldPad, ...]) -> Self:
        """The same trip with another start, on these pads."""
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
        return tuple(
            HeldPad(each.station_id, each.pad, each.start_ms + by_ms, each.end_ms + by_ms)
            for each in self.pads
        )

    def plan(self, requests: Sequence[FleetRequest]) -> Plan:
        """The plan on the pads that it holds; `requests` are all of the problem.

        Its seconds count from the slot. No trip may hold pads in the planner then: call
        `TripPlanner.begin` before.
        """
        if self.found is None:
            raise ValueError(f"the trip of {self.pool} was read from a plan")
        plan = self.found.plan(self.row)
        names = [one.package_id for each in self.pool for one in requests[each].packages]
        pads = iter(self.pads)

        def named(ids: tuple[PackageId, ...]) -> tuple[PackageId, ...]:
            return tuple(names[int(each)] for each in ids)

        steps: list[Step] = []
        for step in plan.steps:
            if isinstance(step, PickUp | Deliver):
                steps.append(step.model_copy(update={"package_ids": named(step.package_ids)}))
            elif isinstance(step, Recharge):
                steps.append(step.model_copy(update={"pad": next(pads).pad}))
            else:
                steps.append(step)
        deliveries = tuple(
            each.model_copy(update={"package_id": names[int(each.package_id)]})
            for each in plan.deliveries
        )
        return plan.model_copy(
            update={"steps": tuple(steps), "deliveries": deliveries, "stats": {}}
        )


class DroneTrip(NamedTuple):
    """A trip, and the number of the drone that flies it."""

    drone: int
    trip: PlannedTrip
