"""What is wrong with a plan, in the eyes of `verify` and of a bracket of the optimum."""

import math

from skyway.delivery.plan import Fly, Plan
from skyway.planner.compose import compose
from skyway.planner.problem import Problem
from skyway.planner.verify import verify
from skyway.units import TIME_TOLERANCE_S
from tests.library.planner.oracles.facts import is_overweight
from tests.library.planner.oracles.grid import Bracket, bracket
from tests.library.planner.oracles.milp import least_delivery_s

#: Seconds; calendars are whole milliseconds, and charges may differ by the planner's tolerance.
_SLACK_S = 0.01

#: Labels after which a contestant gives up.
_MOST_LABELS = 20_000

#: Seconds within which a plan must end, where the test asks why there is none.
_REASON_HORIZON_S = 40_000.0
_ABOUT_TIME = ("NO_PAD_IN_TIME", "TOO_LATE")

#: The mixed-integer model looks for plans of at least so many segments that end before the horizon.
#: It runs for at most the limit, and its times are exact up to the slack.
_LEAST_SEGMENTS, _MILP_HORIZON_S, _MILP_LIMIT_S, _MILP_SLACK_S = 7, 6000.0, 60.0, 0.5


def disagreements(
    problem: Problem, plan: Plan, found: Bracket, *, is_exact: bool = True
) -> list[str]:
    """Every way in which the plan contradicts the bracket; only an exact one may not be late."""
    faults = [f"verify: {violation}" for violation in verify(problem, plan)]
    time_s = plan.delivery_time_s
    if time_s is not None and time_s < found.early_s - _SLACK_S and time_s < found.horizon_s - 3000:
        faults.append(f"{time_s} s is earlier than possible: {found.early_s} s")
    if not is_exact:
        if plan.status == "infeasible" and found.late_s < math.inf:
            faults.append(f"infeasible, yet there is a plan of {found.late_s} s")
        return faults
    if plan.status not in ("optimal", "infeasible"):
        faults.append(f"{plan.status}: nothing is proven")
    elif plan.status == "optimal" and (
        time_s is None
        or plan.lower_bound_s is None
        or not math.isclose(time_s, plan.lower_bound_s, rel_tol=1e-9, abs_tol=1e-6)
    ):
        faults.append(f"optimal at {time_s} s with a bound of {plan.lower_bound_s} s")
    if time_s is None and found.late_s < math.inf:
        faults.append(f"{plan.status}, yet there is a plan of {found.late_s} s")
    if time_s is not None and time_s > found.late_s + _SLACK_S:
        faults.append(f"{time_s} s, yet there is a plan of {found.late_s} s")
    return faults


def disagreements_with_contestants(
    problem: Problem, plan: Plan, *, most_labels: int = _MOST_LABELS
) -> list[str]:
    """Every contestant that found an earlier plan, or a plan for an "impossible" problem."""
    faults = []
    for name in ("heuristic", "exhaustive_with_walks"):
        limits = {"strategy": name, "label_limit": most_labels}
        other = compose(problem.model_copy(update=limits))
        if other.delivery_time_s is None:
            continue
        if plan.delivery_time_s is None:
            faults.append(f"{plan.status}, {name} delivers at {other.delivery_time_s} s")
        elif plan.delivery_time_s > other.delivery_time_s + TIME_TOLERANCE_S:
            faults.append(f"{plan.delivery_time_s} s, {name} delivers at {other.delivery_time_s} s")
    return faults


def disagreements_with_reason(problem: Problem, plan: Plan, *, tick_s: float = 5.0) -> list[str]:
    """What contradicts the reason why there is no plan."""
    if plan.infeasibility is None:
        return []
    code = plan.infeasibility.code
    if is_overweight(problem) or code == "OVERWEIGHT":
        return [] if is_overweight(problem) and code == "OVERWEIGHT" else [f"is it {code}?"]

    def least(**fields: object) -> Bracket:
        other = problem.model_copy(update=fields)
        return bracket(other, tick_s=tick_s, after_s=_REASON_HORIZON_S)

    if math.isinf(least(pad_reservations=(), latest_delivery_s=None).early_s):
        return [f"{code}, yet it is out of range"] if code in _ABOUT_TIME else []
    all_free = least(pad_reservations=())
    if code == "NO_PAD_IN_TIME" and math.isinf(all_free.early_s):
        return [f"{code}, yet free pads would not help"]
    if code == "TOO_LATE" and math.isfinite(all_free.late_s):
        return [f"{code}, yet with free pads it takes {all_free.late_s} s"]
    if code not in _ABOUT_TIME and math.isfinite(least(latest_delivery_s=None).late_s):
        return [f"{code}, yet without latest_delivery_s there is a plan"]
    return []


def disagreements_with_milp(problem: Problem, plan: Plan) -> list[str]:
    """What the mixed-integer model says of a plan without closures; nothing where it gives up."""
    segments = sum(isinstance(step, Fly) for step in plan.steps)
    least_s = least_delivery_s(
        problem,
        most_segments=max(segments, _LEAST_SEGMENTS),
        horizon_s=_MILP_HORIZON_S,
        time_limit_s=_MILP_LIMIT_S,
    )
    if least_s is None:
        return []
    time_s = math.inf if plan.delivery_time_s is None else plan.delivery_time_s
    if time_s < _MILP_HORIZON_S and least_s > time_s + _MILP_SLACK_S:
        return [f"{time_s} s is earlier than the mixed-integer model's {least_s} s"]
    if least_s < time_s - _MILP_SLACK_S:
        return [f"{time_s} s, the mixed-integer model delivers at {least_s} s"]
    return []
