"""Properties of every plan, on random small problems with all features of the format."""

import random
import subprocess
import sys
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from skyway.errors import InvalidProblem
from skyway.planner import compose
from skyway.planner.airspace import Airspace
from skyway.planner.problem import Problem
from skyway.planner.stop import LabelLimit, never
from skyway.planner.verify import verify

BOUNDED = settings(max_examples=50)
SEEDS = st.integers(0, 10_000)


@pytest.fixture(scope="session")
def random_problem(make_network, make_problem, model):
    def make(seed: int, *, stations: int = 6, destinations: int = 3) -> Problem:
        rng = random.Random(seed)
        names = "abcdefgh"[:stations]
        lengths = {
            (start, end): rng.randint(1, 9)
            for number, start in enumerate(names)
            for end in rng.sample(names[:number], min(number, 2))
        }
        words = [f"{a}{rng.choice('---->')}{b}:{length}" for (a, b), length in lengths.items()]
        network = make_network(
            " ".join(words), pads={name: rng.choice([0, 1, 4]) for name in names}
        )
        chosen = rng.sample(names, rng.randint(1, destinations))
        fields: dict[str, Any] = {
            "source": rng.choice(names),
            "station": rng.choice([None, None, rng.choice(names)]),
            "soc": rng.choice([0.4, 0.7, 1.0]),
            "mass_kg": rng.choice([0.0, 0.1, 0.3]),
            "recharge_policy": rng.choice(["partial", "full"]),
            "finish": rng.choice(["recharge", "stay"]),
            "loading_s": rng.choice([0, 60]),
            "dropoff_s": rng.choice([0, 30]),
            "model": model.model_copy(
                update={
                    "reserve_soc": rng.choice([0.0, 0.1]),
                    "speed_full_mps": rng.choice([7.0, 10.0]),
                    "stop_s": rng.choice([0.0, 20.0]),
                    "stop_j": rng.choice([0.0, 500.0]),
                }
            ),
            "pad_reservations": [
                {
                    "station_id": name,
                    "pad": rng.randrange(network.stations[name].pads),
                    "start_s": start_s,
                    "end_s": rng.choice([None, start_s + rng.uniform(1, 2000)]),
                }
                for name in names
                for start_s in [rng.uniform(-500, 3000)]
                if network.stations[name].pads and rng.random() < 0.5
            ],
            "closures": [
                {
                    "from": a,
                    "to": b,
                    "start_s": rng.uniform(0, 900),
                    "end_s": rng.choice([None, 1e3]),
                }
                for a, b in rng.sample(sorted(lengths), 1)
            ]
            + [{"station_id": rng.choice(names), "start_s": 100, "end_s": 900}],
        }
        return make_problem(network, *chosen, **fields)

    return make


def renamed(problem: Problem) -> Problem:
    """The same problem with stations whose names sort the other way round."""
    names = sorted(problem.network.stations, reverse=True)
    new_names = {old: f"s{number}" for number, old in enumerate(names)}

    def rename(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: rename(item) for key, item in value.items()}
        if isinstance(value, list):
            return [rename(item) for item in value]
        return new_names.get(value, value) if isinstance(value, str) else value

    return Problem.model_validate(rename(problem.model_dump(mode="json", by_alias=True)))


@pytest.mark.parametrize("strategy", ["heuristic", "exhaustive"])
@given(seed=SEEDS)
@BOUNDED
def test_every_plan_is_accepted_by_verify(random_problem, strategy: str, seed: int):
    problem = random_problem(seed).model_copy(update={"strategy": strategy, "label_limit": 2000})

    plan = compose(problem)

    assert verify(problem, plan) == ()


def test_random_problems_are_a_fair_mix(random_problem):
    plans = [compose(random_problem(seed)) for seed in range(100)]

    assert sum(plan.status == "feasible" for plan in plans) > 25
    assert {plan.infeasibility.code for plan in plans if plan.infeasibility} >= {
        "OUT_OF_RANGE",
        "DESTINATION_UNREACHABLE",
    }


@given(seed=SEEDS)
@BOUNDED
def test_the_heuristic_is_never_better_than_enumerating_all_walks(random_problem, seed: int):
    problem = random_problem(seed, stations=4, destinations=2)
    found = compose(problem)

    best = compose(problem.model_copy(update={"strategy": "exhaustive_with_walks"}))

    if found.is_flyable:
        assert best.is_flyable
        assert found.delivery_time_s >= best.delivery_time_s - 1e-6


@given(seed=SEEDS)
@BOUNDED
def test_walks_are_never_worse_than_simple_paths(random_problem, seed: int):
    problem = random_problem(seed, stations=4, destinations=2)
    simple = compose(problem.model_copy(update={"strategy": "exhaustive"}))

    walks = compose(problem.model_copy(update={"strategy": "exhaustive_with_walks"}))

    if simple.is_flyable:
        assert walks.delivery_time_s <= simple.delivery_time_s + 1e-6


@given(seed=SEEDS)
@BOUNDED
def test_what_one_strategy_proves_impossible_none_finds(random_problem, seed: int):
    problem = random_problem(seed, stations=5, destinations=2)
    if compose(problem).status != "infeasible":
        return

    other = compose(problem.model_copy(update={"strategy": "exhaustive"}))

    assert other.status == "infeasible"


@given(seed=SEEDS)
@BOUNDED
def test_renaming_stations_does_not_change_the_time(random_problem, seed: int):
    problem = random_problem(seed)

    plan, other = compose(problem), compose(renamed(problem))

    assert plan.status == other.status
    assert plan.delivery_time_s == other.delivery_time_s


@given(seed=SEEDS)
@BOUNDED
def test_the_same_problem_gives_the_same_plan(random_problem, seed: int):
    problem = random_problem(seed)

    plan, again = compose(problem), compose(Problem.model_validate(dict(problem)))

    assert again.steps == plan.steps


def test_a_strategy_that_is_not_there_is_refused_with_the_names_of_those_that_are(make_problem):
    with pytest.raises(InvalidProblem, match=r"strategy: 'exact' is .*; there are heuristic, exh"):
        compose(make_problem("a-b:1", "b", strategy="exact"))


def test_a_stop_ends_the_search(make_problem):
    problem = make_problem("a-b:1 b-c:1", "c")

    assert compose(problem, stop=never).status == "feasible"
    assert compose(problem, stop=LabelLimit(1)).status == "unknown"


def test_a_time_limit_ends_an_enumeration_that_would_not(make_problem):
    names = "abcdefgh"
    complete = " ".join(f"{a}-{b}:1" for a in names for b in names if a < b)

    plan = compose(make_problem(complete, *"bcdefgh", strategy="exhaustive", time_limit_s=0.05))

    assert plan.status == "feasible"
    assert 0.05 <= plan.stats["elapsed_s"] < 1


def test_an_airspace_made_before_gives_the_same_plan(random_problem):
    problem = random_problem(7)

    plan = compose(problem, airspace=Airspace.of(problem.network))

    assert plan.steps == compose(problem).steps


def test_the_result_says_how_it_was_found(make_problem):
    stats = compose(make_problem("a-b:1 b-c:1", "c")).stats

    assert stats["strategy"] == "heuristic"
    assert set(stats) == {
        "strategy",
        "elapsed_s",
        "labels",
        "compositions",
        "stations_searched",
    }


def test_a_plan_s_json_names_an_infeasibility_only_when_it_has_one(make_problem):
    feasible = compose(make_problem("a-b:1", "b")).model_dump(mode="json")
    infeasible = compose(make_problem("a-b:11", "b")).model_dump(mode="json")

    assert "infeasibility" not in feasible
    assert (feasible["lower_bound_s"], infeasible["delivery_time_s"]) == (None, None)
    assert infeasible["infeasibility"]["code"] == "OUT_OF_RANGE"


def test_the_library_alone_imports_no_planner():
    code = "import sys, skyway; print('skyway.planner' in sys.modules)"

    imported = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)

    assert imported.stdout.strip() == b"False"
