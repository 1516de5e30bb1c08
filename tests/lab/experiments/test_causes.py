import pytest
from skyway_lab.experiments.causes import line_problem
from skyway_lab.experiments.instances import SHORT_RANGE, Setting, city_problem

from skyway.delivery.plan import Fly
from skyway.planner import compose
from tests.library.planner.outcomes import delivery_time_s

SETTING = Setting(
    stations=15,
    spacing_m=8_000.0,
    packages=3,
    taken=0.3,
    model=SHORT_RANGE,
    recharge_policy="partial",
)


@pytest.mark.parametrize("seed", range(5))
def test_on_a_fixed_route_the_best_plan_lies_between_the_heuristic_and_the_optimum(seed):
    problem = city_problem(SETTING, seed=seed)
    heuristic = compose(problem.model_copy(update={"strategy": "heuristic"}))
    exact = compose(problem)

    line = compose(line_problem(problem, heuristic))

    assert delivery_time_s(exact) <= delivery_time_s(line) + 1e-6
    assert delivery_time_s(line) <= delivery_time_s(heuristic) + 1e-6


@pytest.mark.parametrize("seed", range(5))
def test_the_line_of_the_best_plan_is_as_fast_as_that_plan(seed):
    problem = city_problem(SETTING, seed=seed)
    exact = compose(problem)

    line = compose(line_problem(problem, exact))

    assert line.delivery_time_s == pytest.approx(exact.delivery_time_s, abs=1e-3)


def test_every_visit_is_a_station_of_its_own():
    problem = city_problem(SETTING, seed=1)
    plan = compose(problem)

    line = line_problem(problem, plan)

    flights = sum(isinstance(step, Fly) for step in plan.steps)
    assert len(line.network.stations) == flights + 1
    assert len(line.network.segments) == flights
