"""Checks a plan against its problem, step by step, sharing no code with the search.

Only the drone's physics and the geometry of zones are shared. The rules are implemented again from
docs/reference/planner-problem.md. Every plan passes here before it leaves the planner.
"""

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from itertools import zip_longest
from typing import TYPE_CHECKING

from skyway.delivery.plan import Plan, PlanStatus, Step
from skyway.drone.cargo import misfit
from skyway.errors import SkywayError
from skyway.planner.problem import Problem
from skyway.planner.replay import Replay, Violation
from skyway.units import TIME_TOLERANCE_S, time_tolerance_s

if TYPE_CHECKING:
    from skyway.planner.pad_book import PadBook

#: Sums over a whole plan may differ by this share: each summand is rounded.
_SUM_TOLERANCE = 1e-9
#: The sums of a plan over its steps.
_SUMS = ("energy_j", "flight_s", "waiting_s", "recharging_s")


class PlanRejected(SkywayError):
    """A plan breaks its problem's rules; `violations` says which."""

    def __init__(self, violations: Sequence[Violation]) -> None:
        super().__init__("; ".join(str(violation) for violation in violations))
        self.violations = tuple(violations)


def verify(
    problem: Problem, plan: Plan, *, booked: "PadBook | None" = None
) -> tuple[Violation, ...]:
    """Every rule that the plan breaks, in the order of its steps; empty for a good plan.

    Parameters
    ----------
    booked
        Booked reservations beside the problem's own, in seconds from the plan's start.
    """
    if not plan.is_flyable:
        return tuple(_of_no_plan(problem, plan))
    moments_s = sum(step.start_s + step.end_s for step in plan.steps)
    if not math.isfinite(moments_s) and (unreal := tuple(_of_numbers(plan.steps))):
        return unreal
    replay = Replay(problem, plan.steps, booked=booked)
    for number, (step, following) in enumerate(zip_longest(plan.steps, plan.steps[1:])):
        replay.check(number, step, following)
    replay.check_end()
    # Any other number that is not finite has broken a rule here, since no comparison holds for it.
    if replay.violations and (unreal := tuple(_of_numbers(plan.steps))):
        return unreal
    return (*replay.violations, *_of_deliveries(problem, plan), *_of_sums(problem, plan))


def _of_numbers(steps: Sequence[Step]) -> Iterator[Violation]:
    """All numbers must be finite."""
    for number, step in enumerate(steps):
        for name, value in vars(step).items():
            if isinstance(value, float) and not math.isfinite(value):
                yield Violation(number, "finite", f"{name} is {value}")


def _of_no_plan(problem: Problem, plan: Plan) -> Iterator[Violation]:
    if plan.steps or plan.deliveries:
        yield Violation(None, "no plan", f"{plan.status} with steps or deliveries")
    if any(getattr(plan, name) is not None for name in ("delivery_time_s", *_SUMS)):
        yield Violation(None, "no plan", f"{plan.status} with times or energies")
    named = plan.infeasibility
    if (named is None) == (plan.status == PlanStatus.INFEASIBLE):
        yield Violation(None, "no plan", "an infeasible plan, and no other, names what makes it so")
        return
    mass_kg = math.fsum(package.mass_kg for package in problem.packages)
    if named is not None and named.code == "OVERWEIGHT":
        if mass_kg <= problem.drone.model.max_payload_kg:
            yield Violation(None, "no plan", f"{mass_kg} kg are not overweight")
    elif named is not None and named.code in ("TOO_LARGE", "HANDLING"):
        if misfit(problem.drone.model, problem.packages) is None:
            yield Violation(None, "no plan", f"{named.code}, and the drone carries all packages")
    elif named is not None and named.code == "TOO_LATE" and problem.latest_delivery_s is None:
        yield Violation(None, "no plan", "nothing is too late without latest_delivery_s")


def _of_deliveries(problem: Problem, plan: Plan) -> Iterator[Violation]:
    """`deliveries` must name each package once, as the DELIVER steps do."""
    stated = sorted(
        (each.package_id, each.station_id, each.delivered_s) for each in plan.deliveries
    )
    done = sorted(
        (package_id, step.station_id, step.end_s)
        for step in plan.steps
        if step.kind == "DELIVER"
        for package_id in step.package_ids
    )
    if [one[:2] for one in stated] != [one[:2] for one in done] or not all(
        abs(stated_s - done_s) <= time_tolerance_s(done_s)
        for (*_, stated_s), (*_, done_s) in zip(stated, done, strict=True)
    ):
        yield Violation(None, "deliveries", "differ from the DELIVER steps")
    asked = sorted(package.package_id for package in problem.packages)
    if [package_id for package_id, _, _ in done] != asked:
        yield Violation(None, "deliveries", "not every package is delivered exactly once")


def _of_sums(problem: Problem, plan: Plan) -> Iterator[Violation]:
    durations_s = defaultdict(list)
    for step in plan.steps:
        durations_s[step.kind].append(step.end_s - step.start_s)
    end_s = max((step.end_s for step in plan.steps if step.kind == "DELIVER"), default=0.0)
    expected = {
        "delivery_time_s": end_s,
        "energy_j": math.fsum(step.energy_j for step in plan.steps if step.kind == "FLY"),
        "flight_s": math.fsum(durations_s["FLY"]),
        "waiting_s": math.fsum(durations_s["WAIT"]),
        "recharging_s": math.fsum(durations_s["RECHARGE"]),
    }
    for name, value in expected.items():
        stated = getattr(plan, name)
        if stated is None or not abs(stated - value) <= TIME_TOLERANCE_S + _SUM_TOLERANCE * abs(
            value
        ):
            yield Violation(None, name, f"{stated} instead of {value}")
    latest_s = problem.latest_delivery_s
    if latest_s is not None and end_s > latest_s + time_tolerance_s(end_s):
        yield Violation(None, "latest_delivery_s", f"{end_s} is after {latest_s}")
    yield from _of_status(plan, end_s)


def _of_status(plan: Plan, end_s: float) -> Iterator[Violation]:
    """A plan is optimal exactly when its own time is proven to be the earliest."""
    bound_s = plan.lower_bound_s
    allowed_s = time_tolerance_s(end_s)
    if bound_s is not None and not bound_s <= end_s + allowed_s:
        yield Violation(None, "lower_bound_s", f"{bound_s} is after {end_s}")
    if plan.status == PlanStatus.OPTIMAL and (bound_s is None or not bound_s >= end_s - allowed_s):
        yield Violation(None, "status", f"optimal at {end_s}, with lower_bound_s {bound_s}")
    if plan.infeasibility is not None:
        yield Violation(None, "status", f"{plan.status} with an infeasibility")
