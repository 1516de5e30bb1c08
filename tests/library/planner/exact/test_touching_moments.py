"""Limits that begin or end at the very moment at which the best plan does something."""

from collections.abc import Callable
from random import Random

import pytest

from skyway.drone.model import ChargePoint, DroneModel
from skyway.planner import compose
from skyway.planner.problem import Problem
from skyway.planner.verify import verify
from skyway.units import time_tolerance_s
from tests.library.planner.oracles.touching import problem_to_touch, touched, uses_of
from tests.long_cases import sampled


@pytest.mark.parametrize("first", sampled(range(0, 1500, 30), every=25))
def test_limits_that_touch_the_best_plan_change_nothing(first: int) -> None:
    for seed in range(first, first + 30):
        made = problem_to_touch(seed)
        plan = compose(Problem.model_validate(made))
        if plan.delivery_time_s is None:
            continue

        limited = Problem.model_validate(touched(made, plan, Random(seed)))
        other = compose(limited)

        assert verify(limited, plan) == (), seed
        assert (plan.status, other.status) == ("optimal", "optimal"), seed
        same_s = 2 * time_tolerance_s(plan.delivery_time_s)
        assert other.delivery_time_s == pytest.approx(plan.delivery_time_s, abs=same_s), seed


@pytest.mark.parametrize("seed", range(0, 30, 3))
def test_a_closure_that_begins_ten_microseconds_too_early_is_met(seed: int) -> None:
    made = problem_to_touch(seed)
    plan = compose(Problem.model_validate(made))
    for what, spans in uses_of(made, plan).items():
        if not isinstance(what, tuple) or spans[-1][1] > 1e6:
            continue
        closure = {"from": what[0], "to": what[1], "start_s": spans[-1][1] - 1e-5}

        limited = Problem.model_validate({**made, "closures": [*made["closures"], closure]})

        assert "closed" in {one.rule for one in verify(limited, plan)}
        assert compose(limited).steps != plan.steps


@pytest.mark.parametrize("latest_delivery_s", [None, 192.0, 300.0])
@pytest.mark.parametrize("soc", [0.5, 0.61, 0.77, 0.9, 0.95, 1.0])
def test_a_closure_that_begins_as_the_flight_ends_delays_no_drone(
    make_problem: Callable[..., Problem],
    model: DroneModel,
    soc: float,
    latest_delivery_s: float | None,
) -> None:
    curve = ((0.0, 0.0), (158.73593316010954, 0.4994696161011541), (533.5826081605426, 1.0))
    slow = {"battery_j": 100_000.0, "stop_s": 2.0}
    problem = make_problem(
        "a-b:1 b-c:0.9",
        "c",
        soc=soc,
        model=model.model_copy(
            update={**slow, "charge_curve": tuple(ChargePoint(*point) for point in curve)}
        ),
        pads={"b": 0},
        closures=[{"from": "a", "to": "b", "start_s": 100.0, "end_s": 1200.0}],
        latest_delivery_s=latest_delivery_s,
    )

    assert compose(problem).delivery_time_s == 192.0
