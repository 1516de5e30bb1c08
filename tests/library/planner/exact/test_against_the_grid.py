"""Exact plans before the fine grid's dynamic programme, all features mixed."""

from collections.abc import Callable

import pytest

from skyway.planner import compose
from skyway.planner.problem import Problem
from tests.library.planner.oracles.grid import bracket
from tests.library.planner.oracles.instances import (
    make_busy_problem,
    make_problem,
    make_problem_with_hours,
    make_stormy_problem,
    make_windowed_problem,
    make_windy_problem,
    weather_of,
)
from tests.library.planner.oracles.judge import disagreements, disagreements_with_reason
from tests.long_cases import sampled

_BLOCK = 25
#: The first seed of each block. One block is enough while somebody waits.
_BLOCKS = sampled(range(0, 300, _BLOCK), every=6)


@pytest.mark.parametrize("first", _BLOCKS)
def test_no_plan_is_later_than_the_grid_s_or_earlier_than_possible(first: int) -> None:
    faults = {}
    for seed in range(first, first + _BLOCK):
        problem = make_problem(seed)
        plan = compose(problem)
        faults[seed] = disagreements(problem, plan, bracket(problem, tick_s=5.0))

    assert {seed: words for seed, words in faults.items() if words} == {}


@pytest.mark.parametrize("make", [make_busy_problem, make_stormy_problem, make_windy_problem])
def test_no_plan_is_later_than_the_grids_with_busy_pads_many_closures_or_weather(
    make: Callable[[int], Problem],
) -> None:
    faults = {}
    for seed in range(40):
        problem = make(seed)
        faults[seed] = disagreements(problem, compose(problem), bracket(problem, tick_s=5.0))

    assert {seed: words for seed, words in faults.items() if words} == {}


@pytest.mark.parametrize("first", _BLOCKS)
def test_no_plan_with_windows_is_later_than_the_grids_or_earlier_than_possible(first: int) -> None:
    faults = {}
    for seed in range(first, first + _BLOCK):
        problem = make_windowed_problem(seed)
        faults[seed] = disagreements(problem, compose(problem), bracket(problem, tick_s=5.0))

    assert {seed: words for seed, words in faults.items() if words} == {}


@pytest.mark.parametrize("first", _BLOCKS)
def test_no_plan_with_opening_hours_is_later_than_the_grids_or_earlier_than_possible(
    first: int,
) -> None:
    faults = {}
    for seed in range(first, first + _BLOCK):
        problem = make_problem_with_hours(seed)
        faults[seed] = disagreements(problem, compose(problem), bracket(problem, tick_s=5.0))

    assert {seed: words for seed, words in faults.items() if words} == {}


def test_no_plan_with_windows_and_weather_is_later_than_the_grids() -> None:
    faults = {}
    for seed in range(300, 340):
        windowed = make_windowed_problem(seed).model_dump(mode="json")
        problem = Problem.model_validate({**windowed, "weather": weather_of(seed, windowed)})
        faults[seed] = disagreements(problem, compose(problem), bracket(problem, tick_s=5.0))

    assert {seed: words for seed, words in faults.items() if words} == {}


def test_the_reason_why_there_is_no_plan_is_true() -> None:
    faults = {}
    for seed in range(1000, 1080):
        problem = make_problem(seed)
        faults[seed] = disagreements_with_reason(problem, compose(problem), tick_s=10.0)

    assert {seed: words for seed, words in faults.items() if words} == {}


def test_many_of_the_problems_have_no_plan() -> None:
    infeasible = [seed for seed in range(100) if compose(make_problem(seed)).status == "infeasible"]

    assert 10 <= len(infeasible) <= 30


@pytest.mark.parametrize(
    "seed",
    [
        # Masses that sum to the payload limit, apart from the last digit.
        454,
        # A segment that opens again later has to be tried then, if no landing is possible before.
        6720,
        # Leaving at 0 ends as the segment closes: the next try must be later than the next float.
        32165,
    ],
)
def test_problems_that_the_sweep_once_found_stay_right(seed: int) -> None:
    problem = make_problem(seed)

    assert disagreements(problem, compose(problem), bracket(problem, tick_s=2.0)) == []
