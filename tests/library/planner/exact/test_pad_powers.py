"""Exact plans on pads of different powers, beside the grid and by hand."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import pytest

from skyway.delivery.plan import Recharge
from skyway.network.network import Network
from skyway.planner import compose
from skyway.planner.problem import Problem
from skyway.planner.verify import verify
from tests.library.planner.oracles.grid import bracket
from tests.library.planner.oracles.instances import (
    make_busy_problem,
    make_problem_with_powers,
    make_windowed_problem,
    make_windy_problem,
    with_powers,
)
from tests.library.planner.oracles.judge import (
    disagreements,
    disagreements_with_contestants,
)
from tests.long_cases import sampled

_BLOCK = 25

#: Labels after which a contestant gives up. For nine problems more labels would give a better plan,
#: but the grid's plan is earlier still. Three problems need more labels for the best plan.
_MOST_LABELS = 5_000
_MORE_LABELS = dict.fromkeys((18, 143, 145), 20_000)


@pytest.mark.parametrize("first", sampled(range(0, 150, _BLOCK), every=6))
def test_no_plan_is_later_than_the_grids_or_earlier_than_possible(first: int) -> None:
    faults = {}
    for seed in range(first, first + _BLOCK):
        problem = make_problem_with_powers(seed)
        plan = compose(problem)
        faults[seed] = disagreements(problem, plan, bracket(problem, tick_s=5.0))
        most_labels = _MORE_LABELS.get(seed, _MOST_LABELS)
        faults[seed] += disagreements_with_contestants(problem, plan, most_labels=most_labels)

    assert {seed: words for seed, words in faults.items() if words} == {}


@pytest.mark.parametrize("make", [make_busy_problem, make_windowed_problem, make_windy_problem])
def test_no_plan_is_later_than_the_grids_with_busy_pads_windows_or_weather(
    make: Callable[[int], Problem],
) -> None:
    faults = {}
    for seed in range(20):
        made = make(seed).model_dump(mode="json")
        problem = Problem.model_validate(with_powers(seed, made))
        faults[seed] = disagreements(problem, compose(problem), bracket(problem, tick_s=5.0))

    assert {seed: words for seed, words in faults.items() if words} == {}


def limited(network: Network, powers_w: Mapping[str, float]) -> Network:
    """The network with these powers of each pad."""
    stations = {
        name: replace(station, properties={"pad_power_w": powers_w[name]})
        if name in powers_w
        else station
        for name, station in network.stations.items()
    }
    return Network(stations, network.segments)


@pytest.fixture
def beyond_range(
    make_network: Callable[..., Network], make_problem: Callable[..., Problem]
) -> Callable[..., Problem]:
    """From a by b to c, 13 km; the drone flies 10 km, and charges with 100 W where it may."""

    def make(powers_w: Mapping[str, float], *, soc: float = 0.8) -> Problem:
        return make_problem(limited(make_network("a-b:8 b-c:5"), powers_w), "c", soc=soc)

    return make


def sessions(problem: Problem) -> list[tuple[Any, ...]]:
    """The station, the seconds, the charge at the end and the power of each session."""
    plan = compose(problem)
    assert verify(problem, plan) == ()
    return [
        (step.station_id, step.end_s - step.start_s, step.soc_end, step.power_w)
        for step in plan.steps
        if isinstance(step, Recharge)
    ]


def test_a_slow_pad_is_used_for_what_the_fast_pad_before_cannot_give(
    beyond_range: Callable[..., Problem],
) -> None:
    assert sessions(beyond_range({"b": 50})) == [
        ("a", pytest.approx(200), 1.0, None),
        ("b", pytest.approx(600), pytest.approx(0.5), 50),
    ]


def test_a_pad_that_is_as_fast_as_the_next_is_used_only_as_far_as_needed(
    beyond_range: Callable[..., Problem],
) -> None:
    assert sessions(beyond_range({"a": 50, "b": 50})) == [
        ("b", pytest.approx(1000), pytest.approx(0.5), 50)
    ]


def test_a_pad_with_more_power_than_the_drone_can_use_changes_no_time(
    beyond_range: Callable[..., Problem],
) -> None:
    assert compose(beyond_range({"a": 200, "b": 1000})).delivery_time_s == pytest.approx(
        compose(beyond_range({})).delivery_time_s
    )


def test_a_detour_to_a_fast_pad_is_taken_if_the_near_pad_is_slow(
    make_network: Callable[..., Network], make_problem: Callable[..., Problem]
) -> None:
    network = make_network("a-b:6 b-c:6 a-d:7 d-c:7")

    near = compose(make_problem(network, "c"))
    far = compose(make_problem(limited(network, {"b": 10}), "c"))

    assert [step.station_id for step in near.steps if isinstance(step, Recharge)] == ["b"]
    assert [step.station_id for step in far.steps if isinstance(step, Recharge)] == ["d"]


def test_a_full_recharge_on_a_slow_pad_takes_as_long_as_the_pad_needs(
    make_network: Callable[..., Network], make_problem: Callable[..., Problem]
) -> None:
    network = limited(make_network("a-b:8 b-c:5"), {"b": 50})
    problem = make_problem(network, "c", recharge_policy="full")

    assert sessions(problem) == [("b", pytest.approx(1600), 1.0, 50)]


@pytest.mark.parametrize("change", [{"power_w": None}, {"power_w": 100.0}, {"end_s": 1900.0}])
def test_a_session_that_claims_another_power_is_refused(
    beyond_range: Callable[..., Problem], change: dict[str, Any]
) -> None:
    problem = beyond_range({"b": 50}, soc=1.0)
    plan = compose(problem)
    number = next(n for n, step in enumerate(plan.steps) if isinstance(step, Recharge))
    steps = [
        *plan.steps[:number],
        plan.steps[number].model_copy(update=change),
        *plan.steps[number + 1 :],
    ]

    assert verify(problem, plan.model_copy(update={"steps": tuple(steps)})) != ()
