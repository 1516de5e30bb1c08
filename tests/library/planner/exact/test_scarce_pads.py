"""Where nearly all pads are taken, methods that shorten the search do not change its result."""

from random import Random

import pytest

from skyway.delivery.plan import Plan
from skyway.drone.models import DJI_MATRICE_300_RTK
from skyway.network.synthetic import synthetic_city
from skyway.planner.airspace import Airspace
from skyway.planner.compose import compose, compose_with
from skyway.planner.exact import exact_with
from skyway.planner.exact_haste import itinerary_found
from skyway.planner.exact_search import LAYERS, ExactSearch
from skyway.planner.exact_task import Method
from skyway.planner.problem import Problem
from skyway.planner.situation import Situation
from skyway.planner.stop import Effort, never


def scarce_problem(seed: int, *, stations: int = 9, packages: int = 3) -> Problem:
    """A small city whose drone recharges often, on pads that are free for minutes."""
    random = Random(f"scarce {seed}")
    network = synthetic_city(stations=stations, seed=seed, pads=random.choice([1, 2]))
    names = random.sample(network.columns.station_ids, packages + 2)
    full_mps, stop_s = random.choice([(23.0, 0.0), (15.0, 0.0), (15.0, 20.0), (30.0, 0.0)])
    model = DJI_MATRICE_300_RTK.model_copy(
        update={
            "battery_j": DJI_MATRICE_300_RTK.battery_j * random.choice([0.2, 0.3]),
            "speed_full_mps": full_mps,
            "stop_s": stop_s,
            "stop_j": 100 * stop_s,
        }
    )
    taken = []
    for station in network.stations.values():
        for pad in range(station.pads):
            at_s = random.uniform(0, 2000)
            while at_s < 30_000:
                end_s = at_s + random.expovariate(1 / 1800)
                taken.append(
                    {"station_id": station.station_id, "pad": pad, "start_s": at_s, "end_s": end_s}
                )
                at_s = end_s + 1 + random.expovariate(1 / 300)
    return Problem.model_validate(
        {
            "network": network,
            "drone": {
                "model": model,
                "soc": random.uniform(0.3, 0.9),
                "station_id": random.choice([names[0], names[1]]),
            },
            "source": names[0],
            "packages": [
                {
                    "package_id": name,
                    "mass_kg": random.uniform(0.1, 2.4 / packages),
                    "destination": name,
                }
                for name in names[2:]
            ],
            "pad_reservations": taken,
            "recharge_policy": random.choice(["partial", "partial", "full"]),
            "dropoff_s": random.choice([0.0, 30.0]),
        }
    )


def _found(problem: Problem, method: Method) -> Plan:
    return compose_with(exact_with(method), problem, name="another method")


def _end_alike(one: Plan, other: Plan) -> bool:
    return one.delivery_time_s == pytest.approx(other.delivery_time_s, abs=1e-6)


def test_comparing_larger_sets_of_deliveries_changes_only_the_effort() -> None:
    saved = 0
    for seed in range(40):
        problem = scarce_problem(seed)

        plan, other = compose(problem), _found(problem, Method(dominance="same set"))

        assert plan.status in ("optimal", "infeasible"), seed
        assert _end_alike(plan, other), seed
        saved += other.stats["labels"] - plan.stats["labels"]
    assert saved > 0


def test_labels_that_may_be_later_change_only_the_effort() -> None:
    recharges = 0
    for seed in range(40):
        problem = scarce_problem(seed, packages=2)
        problem = problem.model_copy(update={"recharge_policy": "full"})

        plan, other = compose(problem), _found(problem, Method(dominance="none"))

        assert _end_alike(plan, other), seed
        recharges += sum(step.kind == "RECHARGE" for step in plan.steps)
    assert recharges > 30


def test_a_first_search_for_any_plan_does_not_change_the_delivery_time() -> None:
    for seed in range(20):
        problem = scarce_problem(seed)

        hasty = _found(problem, Method(labels_before_haste=10))

        assert _end_alike(hasty, compose(problem)), seed


def hard_problem(seed: int) -> Problem:
    """A problem whose proof takes about 10,000 labels, for seeds 10 and 13."""
    return scarce_problem(seed, stations=35, packages=11)


@pytest.mark.parametrize(("label_limit", "late"), [(4_000, 1.25), (8_500, 1.02)])
def test_a_plan_under_a_limit_is_near_the_best_plan(label_limit: int, late: float) -> None:
    for seed in (10, 13):
        problem = hard_problem(seed)
        best, few = compose(problem), problem.model_copy(update={"label_limit": label_limit})

        plan = compose(few)

        assert best.delivery_time_s is not None
        assert plan.delivery_time_s is not None
        assert plan.delivery_time_s <= late * best.delivery_time_s, seed


def test_narrow_searches_between_two_parts_of_the_proof_do_not_change_the_delivery_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    problems = [hard_problem(seed) for seed in (10, 13)]
    best_s = [compose(problem).delivery_time_s for problem in problems]
    monkeypatch.setattr("skyway.planner.exact._WIDER", ((1_000, 16), (1_000, 32), (1_000, 64)))

    for problem, expected_s in zip(problems, best_s, strict=True):
        plan = _found(problem, Method(labels_before_haste=10))

        assert plan.delivery_time_s == pytest.approx(expected_s, abs=1e-6)


def test_a_narrow_search_takes_few_labels_that_need_about_as_long() -> None:
    problem = hard_problem(13)
    situation = Situation.of(problem, Airspace.of(problem.network))
    best_s, labels = compose(problem).delivery_time_s, []

    for width in (8, 32):
        narrow = ExactSearch(situation, method=Method(), width=width)
        narrow.run(Effort(never), most_labels=1 << 20)
        labels.append(narrow.labels)
        itinerary = itinerary_found(situation, narrow)

        assert itinerary is not None
        assert best_s is not None
        assert itinerary.delivered_s >= best_s - 1e-6
    assert labels[0] < 2 * 8 * LAYERS
    assert labels[0] < labels[1]
