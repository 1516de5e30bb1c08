"""Fleet plans over many random small fleets: valid, never worse than arrival order, repeatable."""

from collections import Counter

from hypothesis import given, settings
from hypothesis import strategies as st

from skyway.dispatch.check import violations
from skyway.dispatch.optimise import optimise
from skyway.dispatch.plan import FleetPlan
from skyway.dispatch.problem import FleetProblem
from tests.library.dispatch.fleets import small_fleet

SEEDS = st.integers(min_value=0, max_value=10_000)


def arrival_order(problem: FleetProblem) -> FleetPlan:
    return optimise(problem, rounds=0)


def delivered(plan: FleetPlan) -> dict[str, float]:
    return {one.request_id: one.delivered_s for each in plan.trips for one in each.requests}


@settings(max_examples=15)
@given(SEEDS, st.sampled_from(["none", "requests"]))
def test_a_plan_is_valid_and_never_worse_than_the_arrival_order(seed: int, fairness: str) -> None:
    problem = small_fleet(seed, drones=3, requests=6, fairness=fairness)

    first, plan = arrival_order(problem), optimise(problem, rounds=3, seed=seed, proves=True)

    assert violations(problem, plan) == violations(problem, first) == ()
    assert plan.arrival_order == first.costs
    assert plan.costs.total_s <= first.costs.total_s
    assert plan.lower_bound_s is not None
    assert plan.lower_bound_s <= plan.costs.total_s
    came, comes = delivered(first), delivered(plan)
    for request in problem.requests:
        if request.promised_s is not None and request.request_id in came:
            latest_s = max(request.promised_s, came[request.request_id])
            assert comes[request.request_id] <= latest_s + problem.promise_tolerance_s
    if fairness == "requests":
        owner = {each.drone_id: each.provider_id for each in problem.drones}
        flown, before = (
            Counter(owner[each.drone_id] for each in one.trips for _ in each.requests)
            for one in (plan, first)
        )
        assert all(flown[each] >= before[each] for each in before)
