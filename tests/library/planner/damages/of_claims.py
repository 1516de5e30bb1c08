"""Damages to what a plan says of itself as a whole."""

import math
from collections.abc import Iterator

from skyway.delivery.plan import Infeasibility, Plan
from tests.library.planner.damages.good_plan import GoodPlan


def each_sum_wrong(good: GoodPlan) -> Iterator[Plan]:
    for name in ("delivery_time_s", "energy_j", "flight_s", "waiting_s", "recharging_s"):
        value = getattr(good.plan, name)
        for other in (value - 0.01, value + 0.01, -value - 1, None, math.nan, math.inf):
            yield good.having(**{name: other})


def deliveries_that_tell_something_else(good: GoodPlan) -> Iterator[Plan]:
    deliveries = good.plan.deliveries
    yield good.having(deliveries=())
    for number, told in enumerate(deliveries):
        others = (*deliveries[:number], *deliveries[number + 1 :])
        yield good.having(deliveries=others)
        yield good.having(deliveries=(*deliveries, told))
        for fields in (
            {"package_id": "unknown"},
            {"station_id": "nowhere"},
            {"delivered_s": told.delivered_s - 0.001},
            {"delivered_s": told.delivered_s + 0.001},
            {"delivered_s": math.nan},
        ):
            yield good.having(deliveries=(*others, told.model_copy(update=fields)))


def a_bound_that_is_none(good: GoodPlan) -> Iterator[Plan]:
    for bound_s in (good.plan.delivery_time_s + 0.001, math.inf, math.nan):
        yield good.having(lower_bound_s=bound_s)


def a_proof_that_is_none(good: GoodPlan) -> Iterator[Plan]:
    for bound_s in (None, 0.0, good.plan.delivery_time_s - 0.001, math.nan):
        yield good.having(status="optimal", lower_bound_s=bound_s)


def a_plan_that_denies_itself(good: GoodPlan) -> Iterator[Plan]:
    why = Infeasibility(code="OUT_OF_RANGE", detail="or so")
    yield good.having(infeasibility=why)
    for status in ("infeasible", "unknown"):
        yield good.having(status=status)
        yield good.having(status=status, infeasibility=why)
        yield good.having(status=status, infeasibility=why, steps=(), deliveries=())


#: All of them.
DAMAGES = (
    each_sum_wrong,
    deliveries_that_tell_something_else,
    a_bound_that_is_none,
    a_proof_that_is_none,
    a_plan_that_denies_itself,
)
