"""A plan that the planner made and `verify` accepted, and ways to change it."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from skyway.delivery.plan import Deliver, Fly, PackageDelivery, Plan, Recharge, Step, Wait
from skyway.planner.problem import PadReservation, Problem


@dataclass(frozen=True, slots=True)
class GoodPlan:
    """A problem with a plan for it; `name` identifies it."""

    name: str
    problem: Problem
    plan: Plan

    @property
    def steps(self) -> tuple[Step, ...]:
        return self.plan.steps

    @property
    def recharges(self) -> list[tuple[int, Recharge]]:
        """The recharges that charge something, with their numbers."""
        return [
            (number, step)
            for number, step in enumerate(self.steps)
            if isinstance(step, Recharge) and not is_empty(step)
        ]

    def having(self, **fields: Any) -> Plan:
        """The plan with these fields changed; the other fields are not adjusted."""
        return self.plan.model_copy(update=fields)

    def with_step(self, number: int, *instead: Step) -> Plan:
        """The plan with other steps in place of one."""
        return self.having(steps=(*self.steps[:number], *instead, *self.steps[number + 1 :]))


#: A function from a good plan to broken plans; its docstring says why they are broken.
Damage = Callable[[GoodPlan], Iterable[Plan]]


def is_empty(step: Step) -> bool:
    """Whether it is a wait or a recharge that takes no time, so that it changes nothing.

    This holds on the ground. A drone in the air would have to land: see `a_recharge_in_the_air`.
    """
    return isinstance(step, Wait | Recharge) and step.end_s - step.start_s < 1e-4


def changed(step: Step, **fields: Any) -> Step:
    return step.model_copy(update=fields)


def fitted(plan: Plan, steps: Sequence[Step]) -> Plan:
    """These steps one after another with their durations, and matching sums and deliveries."""
    now_s, laid = 0.0, []
    for step in steps:
        laid.append(changed(step, start_s=now_s, end_s=now_s + (step.end_s - step.start_s)))
        now_s = laid[-1].end_s

    def total_s(kind: type[Step]) -> float:
        return math.fsum(step.end_s - step.start_s for step in laid if isinstance(step, kind))

    return plan.model_copy(
        update={
            "status": "feasible",
            "lower_bound_s": None,
            "steps": tuple(laid),
            "delivery_time_s": now_s,
            "energy_j": math.fsum(step.energy_j for step in laid if isinstance(step, Fly)),
            "flight_s": total_s(Fly),
            "waiting_s": total_s(Wait),
            "recharging_s": total_s(Recharge),
            "deliveries": tuple(
                PackageDelivery(
                    package_id=package_id, station_id=step.station_id, delivered_s=step.end_s
                )
                for step in laid
                if isinstance(step, Deliver)
                for package_id in step.package_ids
            ),
        }
    )


def meets(step: Recharge, held: PadReservation) -> bool:
    """Whether the session meets this reservation by more than a rounding."""
    return (
        held.station_id == step.station_id
        and step.start_s < (math.inf if held.end_s is None else held.end_s) - 0.01
        and held.start_s < step.end_s - 0.01
    )
