"""What a benchmark says of a plan that a limit cut off."""

import pytest
from skyway_lab.benchmarks.planner.solving import Solved

from skyway.delivery.plan import Plan, PlanStatus
from skyway.planner.problem import Problem


@pytest.mark.parametrize(
    ("status", "elapsed_ms", "gap"),
    [(PlanStatus.FEASIBLE, 2_001.0, 0.25), (PlanStatus.OPTIMAL, 2_001.0, None)],
)
def test_only_a_plan_that_was_cut_off_has_a_gap(
    status: PlanStatus, elapsed_ms: float, gap: float | None
) -> None:
    problem = Problem.model_construct(time_limit_s=2.0)  # type: ignore[call-arg]
    plan = Plan.model_construct(status=status, delivery_time_s=500.0, lower_bound_s=400.0)

    assert Solved(problem, elapsed_ms, plan).gap == gap
