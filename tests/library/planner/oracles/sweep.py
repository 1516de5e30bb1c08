"""Thousands of random problems before all judges; prints each disagreement with its problem.

From tests/library/planner: ``python -m oracles.sweep --first 0 --count 10000 --tick 2``. With
``--contestants`` the exact plan is also measured against both contestants (minutes per thousand),
with ``--kind open --milp`` problems without closures go before the mixed-integer model too (seconds
each); ``--kind stormy`` closes much, ``--kind busy`` reserves much.
Exit code 1 when a judge disagrees.
"""

import argparse
import json
import sys
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from skyway.delivery.plan import Plan
from skyway.planner.compose import compose
from skyway.planner.problem import Problem
from skyway.planner.verify import PlanRejected
from tests.library.planner.oracles.grid import bracket
from tests.library.planner.oracles.instances import (
    make_busy_problem,
    make_open_problem,
    make_problem,
    make_stormy_problem,
)
from tests.library.planner.oracles.judge import (
    disagreements,
    disagreements_with_contestants,
    disagreements_with_milp,
    disagreements_with_reason,
)

_MAKERS = {
    "mixed": make_problem,
    "busy": make_busy_problem,
    "open": make_open_problem,
    "stormy": make_stormy_problem,
}

#: Problems after which the sweep says how far it is.
_PROGRESS = 5000


@dataclass(frozen=True, slots=True)
class _Judged:
    plan: Plan | None
    faults: list[str]
    width_s: float
    trail: list[str]


def main(arguments: Sequence[str] | None = None) -> int:
    """Judge the seeds asked for; 1 when something was wrong."""
    parser = argparse.ArgumentParser(prog="oracles.sweep", description=__doc__)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--tick", type=float, default=2.0, help="seconds; 1, 2, 5 or 10")
    parser.add_argument("--strategy", default="exact")
    parser.add_argument("--kind", choices=_MAKERS, default="mixed")
    parser.add_argument("--contestants", action="store_true")
    parser.add_argument("--milp", action="store_true")
    parser.add_argument("--problems", action="store_true", help="print problems as JSON too")
    asked = parser.parse_args(arguments)

    statuses: Counter[str] = Counter()
    wrong, widths_s, started_s = 0, [], time.monotonic()
    for seed in range(asked.first, asked.first + asked.count):
        problem = _MAKERS[asked.kind](seed, strategy=asked.strategy)
        judged = _judge(problem, asked)
        statuses[str(judged.plan.status) if judged.plan else "rejected"] += 1
        widths_s.append(judged.width_s)
        done = seed + 1 - asked.first
        if done % _PROGRESS == 0:
            _print(f"{done} of {asked.count}, {wrong} with disagreements")
        if judged.faults:
            wrong += 1
            _report(seed, problem, judged, has_problem=asked.problems)
    finite = sorted(width for width in widths_s if width < float("inf"))
    median_s = finite[len(finite) // 2] if finite else None
    _print(
        f"{asked.count} problems, {dict(statuses)}, {wrong} with disagreements, brackets "
        f"{median_s} s wide (median), {time.monotonic() - started_s:.0f} s"
    )
    return 1 if wrong else 0


def _judge(problem: Problem, asked: argparse.Namespace) -> _Judged:
    found = bracket(problem, tick_s=asked.tick)
    width_s = found.late_s - found.early_s if found.early_s < found.late_s else 0.0
    try:
        plan = compose(problem)
    except PlanRejected as error:
        return _Judged(None, [f"rejected: {error}"], width_s, found.trail)
    faults = disagreements(problem, plan, found, is_exact=asked.strategy == "exact")
    faults += disagreements_with_reason(problem, plan)
    if asked.contestants:
        faults += disagreements_with_contestants(problem, plan)
    if asked.milp:
        faults += disagreements_with_milp(problem, plan)
    return _Judged(plan, faults, width_s, found.trail)


def _print(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def _report(seed: int, problem: Problem, judged: _Judged, *, has_problem: bool) -> None:
    _print(f"seed {seed}: " + "; ".join(judged.faults))
    for line in judged.trail:
        _print(f"    judge: {line}")
    for step in judged.plan.steps if judged.plan else ():
        _print(f"    plan: {json.dumps(step.model_dump(mode='json', by_alias=True))}")
    if has_problem:
        _print(f"    problem: {problem.model_dump_json(by_alias=True)}")


if __name__ == "__main__":
    sys.exit(main())
