"""Damages to the values that sum up a whole plan."""

import math
from collections.abc import Iterator

from skyway.delivery.plan import Infeasibility, Plan
from tests.library.planner.damages.good_plan import GoodPlan
from tests.library.planner.outcomes import delivery_time_s


def each_sum_wrong(good: GoodPlan) -> Iterator[Plan]:
    for name in ("delivery_time_s", "energy_j", "flight_s", "waiting_s", "recharging_s"):
        value = getattr(good.plan, name)
        for other in (value - 0.01, value + 0.01, -value - 1, None, math.nan, math.inf):
            yield good.having(**{name: other})


def deliveries_that_contradict_the_steps(good: GoodPlan) -> Iterator[Plan]:
    deliveries = good.plan.deliveries
    yield good.having(deliveries=())
    for number, delivery in enumerate(deliveries):
        others = (*deliveries[:number], *deliveries[number + 1 :])
        yield good.having(deliveries=others)
        yield good.having(deliveries=(*deliveries, delivery))
        for fields in (
            {"package_id": "unknown"},
            {"station_id": "nowhere"},
            {"delivered_s": delivery.delivered_s - 0.001},
            {"delivered_s": delivery.delivered_s + 0.001},
            {"delivered_s": math.nan},
        ):
            yield good.having(deliveries=(*others, delivery.model_copy(update=fields)))


def a_wrong_lower_bound(good: GoodPlan) -> Iterator[Plan]:
    for bound_s in (delivery_time_s(good.plan) + 0.001, math.inf, math.nan):
        yield good.having(lower_bound_s=bound_s)


def an_optimal_plan_without_a_matching_bound(good: GoodPlan) -> Iterator[Plan]:
    for bound_s in (None, 0.0, delivery_time_s(good.plan) - 0.001, math.nan):
        yield good.having(status="optimal", lower_bound_s=bound_s)


def a_status_that_contradicts_the_steps(good: GoodPlan) -> Iterator[Plan]:
    why = Infeasibility(code="OUT_OF_RANGE", detail="or so")
    yield good.having(infeasibility=why)
    for status in ("infeasible", "unknown"):
        yield good.having(status=status)
        yield good.having(status=status, infeasibility=why)
        yield good.having(status=status, infeasibility=why, steps=(), deliveries=())


#: All damages of this file.
DAMAGES = (
    each_sum_wrong,
    deliveries_that_contradict_the_steps,
    a_wrong_lower_bound,
    an_optimal_plan_without_a_matching_bound,
    a_status_that_contradicts_the_steps,
)
