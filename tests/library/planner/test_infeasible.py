from collections.abc import Callable
from typing import Any

import pytest

from skyway.drone.cargo import SizeMm
from skyway.drone.model import DroneModel
from skyway.planner import compose
from skyway.planner.pad_book import PadBook
from skyway.planner.problem import PackageToDeliver, Problem
from skyway.planner.verify import verify
from tests.library.planner.outcomes import infeasibility

FOR_GOOD = {"start_s": 0, "end_s": None}


@pytest.mark.parametrize("strategy", ["exact", "heuristic", "exhaustive"])
@pytest.mark.parametrize(
    ("network", "destinations", "fields", "code"),
    [
        ("a-b:1", ["b", "b"], {"mass_kg": 0.6}, "OVERWEIGHT"),
        ("a-b:1 c-b:1 d-e:1", ["d"], {}, "DESTINATION_UNREACHABLE"),
        (
            "a-b:1",
            ["b"],
            {"closures": [{"station_id": "b", **FOR_GOOD}]},
            "DESTINATION_UNREACHABLE",
        ),
        (
            "a-b:1",
            ["b"],
            {"closures": [{"from": "a", "to": "b", **FOR_GOOD}]},
            "DESTINATION_UNREACHABLE",
        ),
        ("b>a:1 a-c:1", ["c"], {"station": "c", "source": "b"}, "DESTINATION_UNREACHABLE"),
        ("a>b:1 a>c:1", ["b", "c"], {}, "DESTINATION_UNREACHABLE"),
        ("a-b:11", ["b"], {}, "OUT_OF_RANGE"),
        ("a-b:6 b-c:6", ["c"], {"pads": {"b": 0}}, "OUT_OF_RANGE"),
        ("a-b:6", ["b"], {"pads": {"b": 0}}, "OUT_OF_RANGE"),
        ("a-b:6", ["b"], {"pads": {"a": 0}, "soc": 0.5}, "OUT_OF_RANGE"),
        ("a-b:8 b-c:5", ["c"], {"latest_delivery_s": 1599.0}, "TOO_LATE"),
    ],
)
def test_a_provably_impossible_problem_names_its_reason(
    make_problem, strategy, network, destinations, fields, code
):
    plan = compose(make_problem(network, *destinations, strategy=strategy, **fields))

    assert plan.status == "infeasible"
    assert infeasibility(plan).code == code
    assert (plan.delivery_time_s, plan.energy_j, plan.steps) == (None, None, ())


def test_an_overweight_problem_names_mass_and_limit(make_problem):
    plan = compose(make_problem("a-b:1", "b", "b", mass_kg=0.75))

    assert infeasibility(plan).detail == (
        "payload 1.5 kg exceeds the 1 kg limit of drone model round"
    )


@pytest.mark.parametrize("policy", ["partial", "full"])
def test_pads_that_are_all_reserved_leave_no_pad_in_time(make_problem, taken, policy):
    problem = make_problem(
        "a-b:8 b-c:5", "c", pad_reservations=taken("b", 0, None), recharge_policy=policy
    )

    plan = compose(problem)

    assert (plan.status, infeasibility(plan).code) == ("infeasible", "NO_PAD_IN_TIME")
    assert "with every pad free it would take" in infeasibility(plan).detail


def test_pads_that_are_free_too_late_leave_no_pad_in_time(make_problem, taken):
    held = taken("b", 0, 1000)
    problem = make_problem("a-b:8 b-c:5", "c", pad_reservations=held, latest_delivery_s=1700.0)

    plan = compose(problem)

    assert (plan.status, infeasibility(plan).code) == ("infeasible", "NO_PAD_IN_TIME")


def test_pads_reserved_in_a_pad_book_count_too(make_problem, taken):
    problem = make_problem("a-b:8 b-c:5", "c", pad_reservations=taken("b", 0, None))
    booked = PadBook.of(problem.network, problem.pad_reservations)

    plan = compose(problem.model_copy(update={"pad_reservations": ()}), booked=booked)

    assert infeasibility(plan).code == "NO_PAD_IN_TIME"


def test_the_detail_says_how_late_the_plan_would_be(make_problem):
    plan = compose(make_problem("a-b:8 b-c:5", "c", latest_delivery_s=1599.0))

    assert infeasibility(plan).code == "TOO_LATE"
    assert "1.000 s more than latest_delivery_s 1599" in infeasibility(plan).detail


def test_the_detail_names_the_battery_that_would_be_enough(make_problem):
    plan = compose(make_problem("a-b:11", "b"))

    assert "more battery it could" in infeasibility(plan).detail


def test_contestants_prove_nothing_because_of_reserved_pads(make_problem, taken):
    reserved = taken("b", 0, None)
    problem = make_problem("a-b:8 b-c:5", "c", pad_reservations=reserved, strategy="heuristic")

    assert compose(problem).status == "unknown"


@pytest.mark.parametrize(("strategy", "status"), [("exact", "optimal"), ("heuristic", "feasible")])
def test_the_least_time_counts_recharging_at_the_fastest_rate(make_problem, strategy, status):
    problem = make_problem("a-b:8 b-c:5", "c", latest_delivery_s=1600.0, strategy=strategy)

    assert compose(problem).status == status


_SMALL = {"cargo_mm": SizeMm(length=300, width=200, height=100)}


@pytest.mark.parametrize(
    ("needs", "code"),
    [
        ({"size_mm": {"length": 301, "width": 200, "height": 100}}, "TOO_LARGE"),
        ({"handling": ["COLD"]}, "HANDLING"),
    ],
)
def test_a_drone_that_may_not_carry_a_package_has_no_plan(
    make_problem: Callable[..., Problem], model: DroneModel, needs: dict[str, Any], code: str
) -> None:
    good = make_problem("a-b:1", "b", model=model.model_copy(update=_SMALL))
    document = good.packages[0].model_dump() | needs
    problem = good.model_copy(update={"packages": (PackageToDeliver.model_validate(document),)})

    plan = compose(problem)

    assert infeasibility(plan).code == code
    assert verify(problem, plan) == ()
    assert [each.rule for each in verify(good, plan)] == ["no plan"]
    assert [each.rule for each in verify(problem, compose(good))] == ["cargo"]
