"""Changes to a good plan that break no rule."""

from collections.abc import Iterator

from skyway.delivery.plan import Deliver, PickUp, Plan, Recharge
from tests.library.planner.damages.good_plan import GoodPlan, changed, meets


def each_pad_another_free_pad(good: GoodPlan) -> Iterator[Plan]:
    for number, step in enumerate(good.steps):
        if isinstance(step, Recharge):
            for pad in range(good.problem.network.stations[step.station_id].pads):
                holders = [held for held in good.problem.pad_reservations if held.pad == pad]
                if not any(meets(step, held) for held in holders):
                    yield good.with_step(number, changed(step, pad=pad))


def lists_in_another_order(good: GoodPlan) -> Iterator[Plan]:
    yield good.having(deliveries=good.plan.deliveries[::-1])
    for number, step in enumerate(good.steps):
        if isinstance(step, PickUp | Deliver):
            yield good.with_step(number, changed(step, package_ids=step.package_ids[::-1]))


def weaker_claims(good: GoodPlan) -> Iterator[Plan]:
    for bound_s in (None, 0.0, good.plan.delivery_time_s):
        yield good.having(status="feasible", lower_bound_s=bound_s)
    yield good.having(status="optimal", lower_bound_s=good.plan.delivery_time_s, stats={})


def each_number_off_by_rounding(good: GoodPlan) -> Iterator[Plan]:
    for number, step in enumerate(good.steps):
        for name in ("start_s", "end_s", "energy_j"):
            if name in type(step).model_fields:
                value = getattr(step, name) + 1e-9
                yield good.with_step(number, changed(step, **{name: value}))


#: All changes of this file.
CHANGES = (
    each_pad_another_free_pad,
    lists_in_another_order,
    weaker_claims,
    each_number_off_by_rounding,
)
