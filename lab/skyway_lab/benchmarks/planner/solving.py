"""A cell measured: its requests planned one after another, within a time."""

import time
from collections.abc import Iterable
from dataclasses import dataclass

from skyway_lab.benchmarks.planner.distribution import Distribution
from skyway_lab.benchmarks.planner.memory import peak_growth_mib
from skyway_lab.benchmarks.planner.prepared import Prepared

from skyway.delivery.plan import Plan, PlanStatus, Recharge
from skyway.planner import compose
from skyway.planner.problem import Problem


@dataclass(frozen=True, slots=True)
class Limits:
    """How many requests a cell has, and when one of them and the whole cell are given up."""

    runs: int
    solve_s: float
    cell_s: float


@dataclass(frozen=True, slots=True)
class Solved:
    """One request planned: how long that took as the caller sees it, and what came out."""

    problem: Problem
    elapsed_ms: float
    plan: Plan

    @property
    def is_finished(self) -> bool:
        """Whether no limit cut it off: it is proven, or the contestant came to its end."""
        limit_s = self.problem.time_limit_s
        is_proven = self.plan.status in (PlanStatus.OPTIMAL, PlanStatus.INFEASIBLE)
        return is_proven or limit_s is None or self.elapsed_ms < 1000 * limit_s

    @property
    def gap(self) -> float | None:
        """The share by which an unproven plan may be later than the best; None without one."""
        delivered_s, bound_s = self.plan.delivery_time_s, self.plan.lower_bound_s
        if self.is_finished or delivered_s is None or bound_s is None:
            return None
        return delivered_s / bound_s - 1.0


@dataclass(frozen=True, slots=True)
class Measured:
    """What the runs of a cell have in common; the limit cut off those that did not finish.

    `gap` is the largest share by which a plan that was cut off may be later than the best one.
    """

    times: Distribution
    limit_ms: float
    proven: int
    gap: float | None
    labels: float
    recharges: float
    peak_mib: float | None


def solve(problem: Problem, prepared: Prepared) -> Solved:
    """Plan one request: search, plan and verification, nothing prepared for this request."""
    started = time.perf_counter()
    plan = compose(
        problem,
        airspace=prepared.airspace,
        booked=prepared.book,
        hierarchy=prepared.hierarchy,
    )
    return Solved(problem, 1000 * (time.perf_counter() - started), plan)


def solve_all(problems: Iterable[Problem], prepared: Prepared, *, limits: Limits) -> list[Solved]:
    """Plan these requests, until the cell's time is over.

    The first is planned once before, uncounted: what is looked up on a network for the first time
    is a matter of the service's start, which has a table of its own.
    """
    solved: list[Solved] = []
    for number, problem in enumerate(problems):
        if number == 0:
            solve(problem, prepared)
            deadline = time.perf_counter() + limits.cell_s
        solved.append(solve(problem, prepared))
        if time.perf_counter() > deadline:
            break
    return solved


def measured(solved: list[Solved], prepared: Prepared, *, limits: Limits) -> Measured:
    """The cell's numbers; the slowest request is planned again for the memory that it needs."""
    finished_ms = [each.elapsed_ms for each in solved if each.is_finished]
    slowest = max(solved, key=lambda each: each.elapsed_ms)
    peak_mib = peak_growth_mib(lambda: solve(slowest.problem, prepared))
    cut_off = len(solved) - len(finished_ms)
    return Measured(
        times=Distribution.of(finished_ms, cut_off=cut_off, asked=limits.runs),
        limit_ms=1000 * limits.solve_s,
        proven=sum(each.plan.status is PlanStatus.OPTIMAL for each in solved),
        gap=max((each.gap for each in solved if each.gap is not None), default=None),
        labels=_mean(float(each.plan.stats["labels"]) for each in solved),
        recharges=_mean(float(_recharges(each.plan)) for each in solved),
        peak_mib=peak_mib,
    )


def _recharges(plan: Plan) -> int:
    return sum(isinstance(step, Recharge) for step in plan.steps)


def _mean(values: Iterable[float]) -> float:
    listed = list(values)
    return sum(listed) / len(listed)
