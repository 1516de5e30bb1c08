"""Plans in moving air, on networks with round numbers; the oracles judge random problems."""

import json
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from skyway.delivery.plan import Fly, Plan
from skyway.dispatch.problem import read_fleet_problem
from skyway.errors import InvalidProblem
from skyway.planner import Hierarchy, compose, read_problem
from skyway.planner.problem import Problem
from skyway.planner.verify import verify
from skyway.planner.weather import Weather, segment_rows
from skyway.planner.weather_document import WeatherDocument
from tests.library.planner.oracles.instances import make_problem as make_random_problem
from tests.library.planner.oracles.instances import make_windy_problem
from tests.library.planner.outcomes import infeasibility

Problems = Callable[..., Problem]


def weather(segments: str, *periods: tuple[float, float | None, list[float | None]]) -> Any:
    """The weather of segments like ``a>b``; a period is its start, its end and its factors."""
    return {
        "segments": [word.split(">") for word in segments.split()],
        "periods": [
            {"start_s": start_s, "end_s": end_s, "time_factors": factors}
            for start_s, end_s, factors in periods
        ],
    }


def words_of(plan: Plan) -> list[str]:
    """The plan in words: each step with its end."""
    return [
        f"{step.kind.lower()} {step.to_id if isinstance(step, Fly) else ''}".strip()
        + f" {step.end_s:.0f}"
        for step in plan.steps
    ]


def test_wind_counts_in_its_direction_alone(make_problem: Problems) -> None:
    wind = weather("a>b b>a", (0, None, [0.5, 2.0]))

    out = compose(make_problem("a-b:4", "b", weather=wind))
    back = compose(make_problem("a-b:4", "a", source="b", weather=wind))

    assert (out.delivery_time_s, back.delivery_time_s) == (200, 800)
    assert [out.energy_j, back.energy_j] == pytest.approx([20_000, 80_000])


def test_a_drone_waits_for_weather_that_makes_it_earlier(make_problem: Problems) -> None:
    wind = weather("a>b", (0, 100, [2.0]), (100, 200, [0.5]))

    plan = compose(make_problem("a-b:8", "b", weather=wind))

    assert words_of(plan) == ["pick_up 0", "wait 100", "fly b 500", "deliver 500"]


def test_a_drone_waits_for_weather_in_which_its_battery_lasts(make_problem: Problems) -> None:
    wind = weather("a>b", (0, 900, [1.5]))

    plan = compose(make_problem("a-b:8", "b", weather=wind))

    assert words_of(plan) == ["pick_up 0", "wait 900", "fly b 1700", "deliver 1700"]


def test_a_flight_keeps_the_weather_in_which_it_begins(make_problem: Problems) -> None:
    wind = weather("a>b b>c", (0, 350, [1.0, 1.0]), (350, None, [1.0, 2.0]))

    plan = compose(make_problem("a-b:3 b-c:3", "c", weather=wind))

    assert words_of(plan) == ["pick_up 0", "fly b 300", "fly c 600", "deliver 600"]


def test_a_flight_without_length_may_begin_when_the_weather_changes(make_problem: Problems) -> None:
    """In either weather it takes as long and as much energy: none."""
    wind = weather("a>b", (60, None, [2.0]))

    plan = compose(make_problem("a-b:0 b-c:3", "c", loading_s=60, weather=wind))

    assert words_of(plan) == ["pick_up 60", "fly b 60", "fly c 360", "deliver 360"]


def test_a_flight_is_over_before_the_weather_closes_the_segment(make_problem: Problems) -> None:
    storm = weather("a>b", (0, 299, [1.0]), (299, 900, [None]))

    plan = compose(make_problem("a-b:3", "b", weather=storm))

    assert words_of(plan) == ["pick_up 0", "wait 900", "fly b 1200", "deliver 1200"]


def test_a_drone_charges_while_it_waits_for_better_weather(make_problem: Problems) -> None:
    wind = weather("a>b", (0, 400, [2.0]), (400, None, [1.0]))

    plan = compose(make_problem("a-b:8", "b", soc=0.4, weather=wind))

    assert words_of(plan) == ["pick_up 0", "recharge 400", "fly b 1200", "deliver 1200"]


def test_another_way_is_flown_where_the_wind_is_kinder(make_problem: Problems) -> None:
    wind = weather("a>b", (0, None, [3.0]))

    plan = compose(make_problem("a-b:3 a-c:3 c-b:3", "b", weather=wind))

    assert words_of(plan) == ["pick_up 0", "fly c 300", "fly b 600", "deliver 600"]


def test_cold_air_costs_energy_and_no_time(make_problem: Problems) -> None:
    cold = weather("a>b", (0, None, [1.0]))
    cold["periods"][0]["energy_factors"] = [1.2]

    plan = compose(make_problem("a-b:4", "b", weather=cold))

    assert [plan.delivery_time_s, plan.energy_j] == pytest.approx([400, 48_000])


def test_weather_that_never_opens_a_segment_is_the_named_reason(make_problem: Problems) -> None:
    storm = weather("a>b", (0, None, [None]))

    reason = infeasibility(compose(make_problem("a-b:4", "b", weather=storm)))

    assert reason.code == "DESTINATION_UNREACHABLE"
    assert reason.detail == (
        "the weather leaves no way to deliver everything; in still air it would take 400.000 s"
    )


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_weather_of_still_air_changes_no_delivery_time(seed: int) -> None:
    problem = make_random_problem(seed)
    ends = [[one.from_id, one.to_id] for one in problem.network.segments]
    period = {"start_s": -9, "end_s": 700, "time_factors": [1.0] * len(ends)}
    still = {"segments": ends, "periods": [period]}
    members = {name: getattr(problem, name) for name in Problem.model_fields}

    plan = compose(Problem.model_validate({**members, "weather": still}))

    assert plan.delivery_time_s == pytest.approx(compose(problem).delivery_time_s)


def test_a_hierarchy_changes_no_plan_in_weather() -> None:
    for seed in range(20):
        problem = make_windy_problem(seed)

        plan = compose(problem, hierarchy=Hierarchy.of(problem.network))

        assert plan.delivery_time_s == pytest.approx(compose(problem).delivery_time_s), seed


@pytest.mark.parametrize(
    ("changed", "rules"),
    [
        (weather("a>b", (0, None, [1.25])), {"duration", "air", "energy", "charge"}),
        (
            weather("a>b", (0, 900, [1.25]), (900, None, [0.5])),
            {"duration", "air", "energy", "charge"},
        ),
        (weather("a>b", (0, 300, [1.0]), (300, None, [None])), {"closed"}),
        (weather("a>b", (0, 10, [None])), {"closed"}),
        (None, set()),
    ],
)
def test_a_plan_for_other_weather_is_refused(
    make_problem: Problems, changed: Any, rules: set[str]
) -> None:
    plan = compose(make_problem("a-b:4", "b", weather=weather("a>b", (0, None, [1.0]))))

    violations = verify(make_problem("a-b:4", "b", weather=changed), plan)

    assert {one.rule for one in violations} == rules


def test_a_plan_that_uses_too_little_energy_is_refused(make_problem: Problems) -> None:
    cold = weather("a>b", (0, None, [1.0]))
    plan = compose(make_problem("a-b:9", "b", weather=cold))
    cold["periods"][0]["energy_factors"] = [1.3]

    violations = verify(make_problem("a-b:9", "b", weather=cold), plan)

    assert {one.rule for one in violations} == {"air", "energy", "charge", "reserve"}


def test_a_plan_names_the_factors_of_its_flights(make_problem: Problems) -> None:
    wind = weather("a>b", (0, None, [1.5]))

    plan = compose(make_problem("a-b:3 b-c:3", "c", weather=wind))

    flights = [step.model_dump() for step in plan.steps if isinstance(step, Fly)]
    assert [each.get("time_factor") for each in flights] == [1.5, None]


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10_000), by_s=st.floats(-2_000, 2_000))
def test_shifted_weather_has_the_same_factors_at_later_moments(seed: int, by_s: float) -> None:
    weather = make_windy_problem(seed).weather
    assert weather is not None

    moved = weather.shifted(by_s)

    for at_s in (-100.0, 0.0, 300.5, 1_000.0):
        assert moved.period_at(at_s + by_s) == weather.period_at(at_s)
    fresh = replace(moved)
    for until_s in (0.0, 700.0, 5_000.0):
        least = moved.least_time_factor(until_s=until_s)
        assert least.tolist() == fresh.least_time_factor(until_s=until_s).tolist()


@pytest.mark.parametrize("strategy", ["heuristic", "exhaustive", "exhaustive_with_walks"])
def test_the_papers_strategies_refuse_weather(make_problem: Problems, strategy: str) -> None:
    problem = make_problem("a-b:4", "b", strategy=strategy, weather=weather("a>b", (0, None, [1])))

    with pytest.raises(InvalidProblem, match="weather: this strategy plans in still air only"):
        compose(problem)


def test_a_dispatch_with_weather_is_refused() -> None:
    with pytest.raises(InvalidProblem, match="weather: is not a known field"):
        read_fleet_problem({"weather": {}})


def test_weather_of_another_network_is_refused(make_problem: Problems) -> None:
    other = make_problem("a-b:5", "b", weather=weather("a>b", (0, None, [1.0]))).weather

    with pytest.raises(InvalidProblem, match="weather: is the weather of another network"):
        make_problem("a-b:4", "b", weather=other)


def test_weather_is_written_as_it_was_read() -> None:
    for seed in range(10):
        problem = make_windy_problem(seed)

        written = json.loads(problem.model_dump_json())

        assert read_problem(written).weather == problem.weather


def air_of(problem: Problem, document: dict[str, Any]) -> Weather:
    """The weather of a document on the problem's network."""
    return Weather.of(problem.network, WeatherDocument.model_validate(document))


def test_each_segment_has_its_own_air_in_any_order_of_the_document(make_problem: Problems) -> None:
    document = weather("b>a a>b", (0, None, [2.0, 3.0]))
    document["periods"][0]["energy_factors"] = [1.2, 1.3]

    found = air_of(make_problem("a-b:4", "b"), document)

    assert found.air_between("b", "a", at_s=0.0) == (2.0, 1.2)
    assert found.air_between("a", "b", at_s=0.0) == (3.0, 1.3)


def test_still_air_before_and_after_the_periods_bounds_the_energy(make_problem: Problems) -> None:
    document = weather("a>b b>a", (100, 200, [1.0, 1.0]))
    document["periods"][0]["energy_factors"] = [1.5, 1.4]
    found = air_of(make_problem("a-b:4", "b"), document)

    bounds = [found.least_energy_factor(until_s=each) for each in (50, 150, 250)]
    in_period = found.shifted(-120.0)

    assert bounds == [1.0, 1.0, 1.0]
    assert in_period.least_energy_factor(until_s=50) == 1.4
    assert in_period.least_energy_factor(until_s=150) == 1.0


def test_a_segment_that_closes_during_a_flight_is_closed_for_it(make_problem: Problems) -> None:
    document = weather("a>b", (0, 100, [2.0]), (100, 200, [None]))
    found = air_of(make_problem("a-b:4", "b"), document)

    assert not found.closes("a", "b", start_s=10, end_s=90)
    assert found.closes("a", "b", start_s=10, end_s=110)
    [segment] = segment_rows(found.network, [("a", "b")])
    air = found.air_between("a", "b", at_s=10)
    met = [found.has_air(segment, air, start_s=10, end_s=end_s, within_s=1) for end_s in (90, 110)]
    assert met == [True, False]
