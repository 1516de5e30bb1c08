"""Checks a plan against its problem, step by step, sharing no code with the search.

Only the drone's physics and the geometry of zones are shared; the rules are read from planner.md
anew. Every plan passes here before it leaves the planner.
"""

import math
from collections.abc import Sequence

from skyway.delivery.plan import Deliver, Fly, Plan, PlanStatus, Recharge, Step, Wait
from skyway.errors import SkywayError
from skyway.planner.problem import Problem
from skyway.planner.replay import Replay
from skyway.planner.violation import Violation
from skyway.units import TIME_TOLERANCE_S

#: Sums over a whole plan may differ by this share: each summand is rounded.
_SUM_TOLERANCE = 1e-9


class PlanRejected(SkywayError):
    """A plan breaks its problem's rules; `violations` says which."""

    def __init__(self, violations: Sequence[Violation]) -> None:
        super().__init__("; ".join(str(violation) for violation in violations))
        self.violations = tuple(violations)


def verify(problem: Problem, plan: Plan) -> tuple[Violation, ...]:
    """Every rule that the plan breaks, in the order of its steps; empty for a good plan."""
    if not plan.is_flyable:
        return tuple(_of_no_plan(plan))
    replay = Replay(problem)
    for number, step in enumerate(plan.steps):
        following = plan.steps[number + 1] if number + 1 < len(plan.steps) else None
        replay.check(number, step, following)
        if not math.isfinite(step.end_s):
            return tuple(replay.violations)
    replay.check_end()
    return (*replay.violations, *_of_deliveries(problem, plan), *_of_sums(problem, plan))


def _of_no_plan(plan: Plan) -> list[Violation]:
    found = []
    if plan.steps or plan.deliveries:
        found.append(Violation(None, "no plan", f"{plan.status} with steps or deliveries"))
    if plan.delivery_time_s is not None or plan.energy_j is not None:
        found.append(Violation(None, "no plan", f"{plan.status} with times or energies"))
    if (plan.infeasibility is None) == (plan.status is PlanStatus.INFEASIBLE):
        found.append(Violation(None, "no plan", "only an infeasible plan names an infeasibility"))
    return found


def _of_deliveries(problem: Problem, plan: Plan) -> list[Violation]:
    """`deliveries` must say of each package once what the DELIVER steps say."""
    told = sorted((told.package_id, told.station_id, told.delivered_s) for told in plan.deliveries)
    done = sorted(
        (package_id, step.station_id, step.end_s)
        for step in plan.steps
        if isinstance(step, Deliver)
        for package_id in step.package_ids
    )
    found = []
    if told != done:
        found.append(Violation(None, "deliveries", "differ from the DELIVER steps"))
    asked = sorted(package.package_id for package in problem.packages)
    if [package_id for package_id, _, _ in done] != asked:
        found.append(Violation(None, "deliveries", "not every package is delivered exactly once"))
    return found


def _of_sums(problem: Problem, plan: Plan) -> list[Violation]:
    found: list[Violation] = []
    end_s = plan.steps[-1].end_s if plan.steps else 0.0
    for name, told, expected in (
        ("delivery_time_s", plan.delivery_time_s, end_s),
        ("energy_j", plan.energy_j, sum(s.energy_j for s in plan.steps if isinstance(s, Fly))),
        ("flight_s", plan.flight_s, _total_s(plan.steps, Fly)),
        ("waiting_s", plan.waiting_s, _total_s(plan.steps, Wait)),
        ("recharging_s", plan.recharging_s, _total_s(plan.steps, Recharge)),
    ):
        allowed = TIME_TOLERANCE_S + _SUM_TOLERANCE * abs(expected)
        if told is None or not abs(told - expected) <= allowed:
            found.append(Violation(None, name, f"{told} instead of {expected}"))
    latest_s = problem.latest_delivery_s
    if latest_s is not None and end_s > latest_s + TIME_TOLERANCE_S:
        found.append(Violation(None, "latest_delivery_s", f"{end_s} is after {latest_s}"))
    bound_s = plan.lower_bound_s
    if bound_s is not None and bound_s > end_s + TIME_TOLERANCE_S:
        found.append(Violation(None, "lower_bound_s", f"{bound_s} is after {end_s}"))
    return found


def _total_s(steps: Sequence[Step], kind: type[Step]) -> float:
    return sum(step.end_s - step.start_s for step in steps if isinstance(step, kind))
