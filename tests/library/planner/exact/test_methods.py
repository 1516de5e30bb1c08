"""The exact search with parts switched off, in fixed orders, under limits, and not compiled."""

import json
import math
import os
import subprocess
import sys
from itertools import permutations
from pathlib import Path

import pytest

from skyway.planner import compose
from skyway.planner.airspace import Airspace
from skyway.planner.exact import exact_with
from skyway.planner.exact_task import Method
from skyway.planner.findings import Strategy
from skyway.planner.problem import Problem
from skyway.planner.situation import Situation
from skyway.planner.stop import Effort, never
from tests.library.planner.oracles.grid import bracket
from tests.library.planner.oracles.instances import make_problem

_SEEDS = range(7000, 7025)


@pytest.mark.parametrize(
    "method", [Method(bound="flight"), Method(bound="none"), Method(dominance="none")]
)
def test_bounds_and_dominance_change_only_the_effort(method: Method) -> None:
    for seed in _SEEDS:
        problem = make_problem(seed)

        if len({package.destination for package in problem.packages}) <= 2:
            assert _time_s(problem, exact_with(method)) == pytest.approx(_best_s(problem)), seed


def test_charging_by_levels_is_never_earlier() -> None:
    for seed in _SEEDS:
        problem = make_problem(seed)

        assert _time_s(problem, exact_with(Method(charging=4))) >= _best_s(problem) - 1e-3, seed


def test_the_best_of_all_fixed_orders_is_the_best() -> None:
    for seed in _SEEDS:
        problem = make_problem(seed)
        destinations = Situation.of(problem, Airspace.of(problem.network)).destinations

        best_s = min(
            _time_s(problem, exact_with(Method(), order=order))
            for order in permutations(destinations)
        )

        assert best_s == pytest.approx(_best_s(problem), abs=1e-6), seed


@pytest.mark.parametrize("label_limit", [1, 5, 20, 60])
def test_a_search_that_ends_early_claims_nothing_false(label_limit: int) -> None:
    for seed in _SEEDS:
        plan = compose(make_problem(seed, label_limit=label_limit))
        found = bracket(make_problem(seed), tick_s=5.0)

        if plan.status == "infeasible":
            assert math.isinf(found.late_s), seed
        if plan.delivery_time_s is not None:
            assert plan.delivery_time_s >= found.early_s - 0.01, seed
        if plan.lower_bound_s is not None:
            assert plan.lower_bound_s <= found.late_s + 0.01, seed


def test_plain_python_finds_the_same_plans() -> None:
    seeds = list(range(8))
    code = (
        "import json, sys; from oracles.instances import make_problem;"
        "from skyway.planner import compose;"
        f"plans = [compose(make_problem(seed)) for seed in {seeds}];"
        "json.dump([plan.model_dump(mode='json', exclude={'stats'}) for plan in plans], sys.stdout)"
    )
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    environment["PYTHONPATH"] = str(Path(__file__).parents[1])

    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, check=True, text=True
    )

    compiled = [compose(make_problem(seed)) for seed in seeds]
    assert json.loads(done.stdout) == json.loads(
        json.dumps([plan.model_dump(mode="json", exclude={"stats"}) for plan in compiled])
    )


def _best_s(problem: Problem) -> float:
    plan = compose(problem)
    return math.inf if plan.delivery_time_s is None else plan.delivery_time_s


def _time_s(problem: Problem, strategy: Strategy) -> float:
    if compose(problem).infeasibility is not None:
        return math.inf
    situation = Situation.of(problem, Airspace.of(problem.network))
    itinerary = strategy(situation, Effort(never)).itinerary
    return math.inf if itinerary is None else itinerary.delivered_s
