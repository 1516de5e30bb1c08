"""Properties of every plan, on random small problems with all features of the format."""

import random
import subprocess
import sys
from collections.abc import Callable
from time import thread_time
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from skyway.delivery.plan import Plan
from skyway.drone.model import DroneModel
from skyway.errors import InvalidProblem
from skyway.ids import StationId
from skyway.network.network import Network
from skyway.planner import compose
from skyway.planner.airspace import Airspace
from skyway.planner.problem import Problem
from skyway.planner.stop import LabelLimit, never
from skyway.planner.verify import verify
from tests.library.planner.damages.good_plans import good_plans
from tests.library.planner.outcomes import delivery_time_s, lower_bound_s

BOUNDED = settings(max_examples=50)
SEEDS = st.integers(0, 10_000)


@pytest.fixture(scope="session")
def random_problem(
    make_network: Callable[..., Network], make_problem: Callable[..., Problem], model: DroneModel
) -> Callable[..., Problem]:
    def make(seed: int, *, stations: int = 6, destinations: int = 3) -> Problem:
        rng = random.Random(seed)
        names = [StationId(name) for name in "abcdefgh"[:stations]]
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


@pytest.fixture(scope="session")
def crowded_problem(make_network, make_problem):
    """Twelve destinations among pads that are hardly ever free: proving the best takes long."""
    rng = random.Random(5)
    network = make_network(_grid(8), pads={})
    places = sorted(network.stations)
    held = [
        {"station_id": place, "pad": pad, "start_s": start_s, "end_s": start_s + 280}
        for place in places
        for pad in range(4)
        for start_s in range(rng.randrange(-300, 0), 30_000, 300)
    ]
    return make_problem(
        network, *rng.sample(places[1:], 12), source=places[0], pad_reservations=held
    )


def _grid(side: int) -> str:
    """The words of a grid of `side` times `side` stations, 2 to 5 km apart."""
    rng = random.Random(side)
    name = {(x, y): f"{chr(97 + x)}{chr(97 + y)}" for x in range(side) for y in range(side)}
    return " ".join(
        f"{name[x, y]}-{name[x + dx, y + dy]}:{rng.randint(2, 5)}"
        for x, y in name
        for dx, dy in ((1, 0), (0, 1))
        if (x + dx, y + dy) in name
    )


def renamed(problem: Problem) -> Problem:
    """The same problem with stations whose names sort the other way round."""
    names = sorted(problem.network.stations, reverse=True)
    new_names: dict[str, str] = {old: f"s{number}" for number, old in enumerate(names)}

    def rename(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: rename(item) for key, item in value.items()}
        if isinstance(value, list):
            return [rename(item) for item in value]
        return new_names.get(value, value) if isinstance(value, str) else value

    return Problem.model_validate(rename(problem.model_dump(mode="json", by_alias=True)))


@pytest.mark.parametrize("strategy", ["exact", "heuristic", "exhaustive"])
@given(seed=SEEDS)
@BOUNDED
def test_every_plan_is_accepted_by_verify(random_problem, strategy: str, seed: int):
    problem = random_problem(seed).model_copy(update={"strategy": strategy, "label_limit": 2000})

    plan = compose(problem)

    assert verify(problem, plan) == ()


def test_every_plan_equals_what_is_read_from_its_json():
    """Plans are made without validation; the text of a float differs from that of an integer."""
    for good in good_plans():
        read = Plan.model_validate_json(good.plan.model_dump_json())

        assert repr(read) == repr(good.plan)


def test_random_problems_include_all_kinds(random_problem):
    plans = [compose(random_problem(seed)) for seed in range(100)]

    assert sum(plan.status == "optimal" for plan in plans) > 25
    assert {plan.infeasibility.code for plan in plans if plan.infeasibility} >= {
        "OUT_OF_RANGE",
        "DESTINATION_UNREACHABLE",
        "NO_PAD_IN_TIME",
    }


def test_the_default_strategy_always_proves_its_answer(random_problem):
    for seed in range(100):
        plan = compose(random_problem(seed))

        assert plan.status in ("optimal", "infeasible")
        if plan.status == "optimal":
            assert plan.lower_bound_s == pytest.approx(plan.delivery_time_s, abs=1e-6)


@given(seed=SEEDS)
@BOUNDED
def test_the_heuristic_is_never_better_than_enumerating_all_walks(random_problem, seed: int):
    problem = random_problem(seed, stations=4, destinations=2)
    found = compose(problem.model_copy(update={"strategy": "heuristic"}))

    best = compose(problem.model_copy(update={"strategy": "exhaustive_with_walks"}))

    if found.is_flyable:
        assert best.is_flyable
        assert delivery_time_s(found) >= delivery_time_s(best) - 1e-6


@given(seed=SEEDS)
@BOUNDED
def test_walks_are_never_worse_than_simple_paths(random_problem, seed: int):
    problem = random_problem(seed, stations=4, destinations=2)
    simple = compose(problem.model_copy(update={"strategy": "exhaustive"}))

    walks = compose(problem.model_copy(update={"strategy": "exhaustive_with_walks"}))

    if simple.is_flyable:
        assert delivery_time_s(walks) <= delivery_time_s(simple) + 1e-6


@given(seed=SEEDS)
@BOUNDED
def test_no_strategy_finds_a_plan_that_another_proves_impossible(random_problem, seed: int):
    problem = random_problem(seed, stations=5, destinations=2)
    if compose(problem).status != "infeasible":
        return

    other = compose(problem.model_copy(update={"strategy": "exhaustive"}))

    assert not other.is_flyable


@given(seed=SEEDS)
@BOUNDED
def test_exact_is_never_later_than_another_strategy(random_problem, seed: int):
    problem = random_problem(seed, stations=4, destinations=2)
    exact = compose(problem)

    for strategy in ("heuristic", "exhaustive_with_walks"):
        other = compose(problem.model_copy(update={"strategy": strategy}))

        if other.is_flyable:
            assert delivery_time_s(exact) <= delivery_time_s(other) + 1e-6


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


def test_an_unknown_strategy_is_refused_with_the_names_of_all_strategies(make_problem):
    with pytest.raises(InvalidProblem, match=r"'best' is .*; there are exact, heuristic, exh"):
        compose(make_problem("a-b:1", "b", strategy="best"))


def test_a_stop_ends_the_search(make_problem):
    problem = make_problem("a-b:1 b-c:1", "c", strategy="heuristic")

    assert compose(problem, stop=never).status == "feasible"
    assert compose(problem, stop=LabelLimit(1)).status == "unknown"


def test_without_a_strategy_the_exact_one_is_used(make_problem):
    plan = compose(make_problem("a-b:1", "b"))

    assert (plan.status, plan.stats["strategy"]) == ("optimal", "exact")


def test_a_label_limit_always_ends_the_exact_search_at_the_same_place(crowded_problem):
    limited = crowded_problem.model_copy(update={"label_limit": 20_000})

    plan, again = compose(limited), compose(limited)

    assert plan.status == "feasible"
    assert (again.steps, again.lower_bound_s) == (plan.steps, plan.lower_bound_s)
    assert again.stats["labels"] == plan.stats["labels"]


def test_a_plan_without_proof_shows_its_gap(crowded_problem):
    limited = crowded_problem.model_copy(update={"label_limit": 20_000})

    plan = compose(limited)

    assert 0 < lower_bound_s(plan) < delivery_time_s(plan)


def test_too_few_labels_give_unknown_and_a_lower_bound(crowded_problem):
    plan = compose(crowded_problem.model_copy(update={"label_limit": 10}))

    assert (plan.status, plan.steps) == ("unknown", ())
    assert lower_bound_s(plan) > 0


def test_a_time_limit_ends_the_exact_search_soon(crowded_problem):
    began_s = thread_time()

    plan = compose(crowded_problem.model_copy(update={"time_limit_s": 0.05}))

    assert plan.status in ("feasible", "unknown")
    assert thread_time() - began_s < 1


def test_a_stop_cancels_the_exact_search(crowded_problem):
    looks: list[int] = []

    def stop(labels: int) -> bool:
        looks.append(labels)
        return True

    plan = compose(crowded_problem, stop=stop)

    assert plan.status in ("feasible", "unknown")
    assert len(looks) <= 3


def test_a_time_limit_ends_an_endless_enumeration(make_problem):
    names = "abcdefgh"
    complete = " ".join(f"{a}-{b}:1" for a in names for b in names if a < b)

    began_s = thread_time()

    plan = compose(make_problem(complete, *"bcdefgh", strategy="exhaustive", time_limit_s=0.3))

    assert plan.status == "feasible"
    assert plan.stats["elapsed_s"] >= 0.3
    assert thread_time() - began_s < 1


def test_a_prepared_airspace_gives_the_same_plan(random_problem):
    problem = random_problem(7)

    plan = compose(problem, airspace=Airspace.of(problem.network))

    assert plan.steps == compose(problem).steps


def test_the_stats_say_how_the_plan_was_found(make_problem):
    stats = compose(make_problem("a-b:1 b-c:1", "c")).stats

    assert stats["strategy"] == "exact"
    assert set(stats) == {
        "strategy",
        "elapsed_s",
        "labels",
        "compositions",
        "stations_searched",
    }


def test_a_plan_s_json_names_an_infeasibility_only_when_it_has_one(make_problem):
    problem = make_problem("a-b:1", "b", strategy="heuristic")
    feasible = compose(problem).model_dump(mode="json")
    infeasible = compose(make_problem("a-b:11", "b")).model_dump(mode="json")

    assert "infeasibility" not in feasible
    assert (feasible["lower_bound_s"], infeasible["delivery_time_s"]) == (None, None)
    assert infeasible["infeasibility"]["code"] == "OUT_OF_RANGE"


def test_the_library_alone_imports_no_planner():
    code = "import sys, skyway; print('skyway.planner' in sys.modules)"

    imported = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)

    assert imported.stdout.strip() == b"False"


def test_a_drone_waits_further_on_when_leaving_later_would_meet_a_closure(
    make_problem: Callable[..., Problem],
) -> None:
    closures = [
        {"station_id": "c", "start_s": 60, "end_s": 910},
        {"from": "a", "to": "b", "start_s": 560, "end_s": 960},
    ]
    problem = make_problem("a-b:3 b-c:1.5", "c", pads={"b": 0}, closures=closures)

    plan = compose(problem)

    assert plan.delivery_time_s == 910
    assert [step.kind for step in plan.steps] == ["PICK_UP", "FLY", "WAIT", "FLY", "DELIVER"]
