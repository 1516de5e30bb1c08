"""Every kind of broken plan is caught. A broken plan is a good plan with one change."""

import math
from collections.abc import Callable, Mapping
from typing import Any

import pytest

from skyway.delivery.plan import Plan
from skyway.planner import compose
from skyway.planner.problem import Problem
from skyway.planner.verify import verify


def rules(problem: Problem, plan: Plan) -> set[str]:
    return {violation.rule for violation in verify(problem, plan)}


def with_step(plan: Plan, number: int, **changes: Any) -> Plan:
    """The plan with one step changed and nothing else made to fit."""
    steps = list(plan.steps)
    steps[number] = steps[number].model_copy(update=changes)
    return plan.model_copy(update={"steps": tuple(steps)})


def without_step(plan: Plan, number: int) -> Plan:
    steps = plan.steps[:number] + plan.steps[number + 1 :]
    return plan.model_copy(update={"steps": steps})


@pytest.fixture
def problem(make_problem: Callable[..., Problem]) -> Problem:
    return make_problem("a-b:8 b-c:5 c-d:2", "c", "d", mass_kg=0.0)


@pytest.fixture
def plan(problem: Problem) -> Plan:
    """PICK_UP, FLY b, RECHARGE, FLY c, DELIVER, RECHARGE, FLY d, DELIVER."""
    return compose(problem)


def changed(problem: Problem, **fields: Any) -> Problem:
    return Problem.model_validate({**dict(problem), **fields})


def test_a_composed_plan_is_accepted(problem, plan):
    assert [step.kind for step in plan.steps] == [
        "PICK_UP",
        "FLY",
        "RECHARGE",
        "FLY",
        "DELIVER",
        "RECHARGE",
        "FLY",
        "DELIVER",
    ]
    assert verify(problem, plan) == ()


@pytest.mark.parametrize(
    ("step", "changes", "rule"),
    [
        (0, {"station_id": "b"}, "pickup"),
        (0, {"package_ids": ("p1",)}, "pickup"),
        (1, {"end_s": 799.0}, "duration"),
        (1, {"end_s": 0.8}, "duration"),  # milliseconds for seconds
        (1, {"energy_j": 80.0}, "energy"),  # kilojoules for joules
        (1, {"load_kg": 0.1}, "load"),
        (1, {"soc_end": 0.3}, "charge"),
        (1, {"to_id": "c"}, "segment"),
        (1, {"from_id": "b"}, "place"),
        (1, {"start_s": 10.0}, "time"),
        (2, {"soc_start": 0.5}, "charge"),
        (2, {"soc_end": 0.9}, "charge"),
        (2, {"end_s": 1000.0}, "charge"),
        (2, {"end_s": 700.0}, "time"),
        (2, {"pad": 4}, "pad"),
        (2, {"pad": -1}, "pad"),
        (2, {"station_id": "c"}, "place"),
        (4, {"package_ids": ()}, "delivery"),
        (4, {"package_ids": ("p1", "p2")}, "delivery"),
        (4, {"end_s": 1700.0}, "duration"),
        (7, {"station_id": "c"}, "delivery"),
    ],
)
def test_a_step_that_does_not_fit_is_caught(
    problem, plan, step: int, changes: Mapping[str, Any], rule: str
):
    assert rule in rules(problem, with_step(plan, step, **changes))


@pytest.mark.parametrize(
    ("step", "rule"),
    [(0, "hand-over"), (2, "reserve"), (3, "place"), (4, "hand-over"), (7, "delivery")],
)
def test_a_step_that_is_missing_is_caught(problem, plan, step: int, rule: str):
    assert rule in rules(problem, without_step(plan, step))


@pytest.mark.parametrize(
    "name", ["delivery_time_s", "energy_j", "flight_s", "waiting_s", "recharging_s"]
)
def test_a_sum_that_is_wrong_or_missing_is_caught(problem, plan, name: str):
    total = getattr(plan, name)

    assert name in rules(problem, plan.model_copy(update={name: total + 0.01}))
    assert name in rules(problem, plan.model_copy(update={name: None}))


def test_deliveries_that_contradict_the_steps_are_caught(problem, plan):
    first, second = plan.deliveries
    early = first.model_copy(update={"delivered_s": first.delivered_s - 1})

    assert "deliveries" in rules(problem, plan.model_copy(update={"deliveries": (early, second)}))
    assert "deliveries" in rules(problem, plan.model_copy(update={"deliveries": (first,)}))


def test_energies_that_are_not_finite_are_named_even_if_they_have_no_sum(problem, plan):
    endless = with_step(with_step(plan, 1, energy_j=math.inf), 3, energy_j=-math.inf)

    found = [(violation.step, violation.rule) for violation in verify(problem, endless)]

    assert found == [(1, "finite"), (3, "finite")]


def test_a_payload_that_was_ignored_is_caught(problem, plan):
    heavy = [package.model_copy(update={"mass_kg": 0.4}) for package in problem.packages]

    found = rules(changed(problem, packages=heavy), plan)

    assert {"load", "energy", "charge"} <= found


def test_a_payload_above_the_limit_is_caught(problem, plan):
    heavy = [package.model_copy(update={"mass_kg": 0.6}) for package in problem.packages]

    assert "payload" in rules(changed(problem, packages=heavy), plan)


def test_a_reserve_that_was_ignored_is_caught(problem, plan, model):
    drone = {"model": model.model_copy(update={"reserve_soc": 0.01}), "soc": 1.0}

    assert "reserve" in rules(changed(problem, drone=drone), plan)


@pytest.mark.parametrize(
    ("start_s", "end_s", "is_refused"),
    [
        (0.0, 800.0, False),
        (0.0, 800.001, True),
        (1100.0, 1200.0, False),
        (1099.999, None, True),
        (900.0, 901.0, True),
        (0.0, None, True),
    ],
)
def test_sessions_may_touch_a_reservation_but_not_overlap(
    problem, plan, start_s: float, end_s: float | None, is_refused: bool
):
    assert (plan.steps[2].start_s, plan.steps[2].end_s) == (800.0, pytest.approx(1100.0))
    reserved = [{"station_id": "b", "pad": 0, "start_s": start_s, "end_s": end_s}]

    found = rules(changed(problem, pad_reservations=reserved), plan)

    assert found == ({"pad"} if is_refused else set())


def test_the_reservation_of_another_pad_does_not_matter(problem, plan):
    reserved = [{"station_id": "b", "pad": 1, "start_s": 0.0, "end_s": None}]

    assert verify(changed(problem, pad_reservations=reserved), plan) == ()


@pytest.mark.parametrize(
    ("closure", "is_refused"),
    [
        ({"from": "b", "to": "c", "start_s": 1000, "end_s": 1100}, False),
        ({"from": "b", "to": "c", "start_s": 1000, "end_s": 1101}, True),
        ({"from": "b", "to": "c", "start_s": 1600}, False),
        ({"from": "b", "to": "c", "start_s": 1599}, True),
        ({"from": "c", "to": "b", "start_s": 0}, False),
        ({"station_id": "c", "start_s": 1599, "end_s": 1601}, True),
        ({"station_id": "c", "start_s": 1601}, False),
        ({"station_id": "a", "start_s": 0}, False),
    ],
)
def test_flying_or_landing_where_it_is_closed_is_caught(
    problem, plan, closure: Mapping[str, Any], is_refused: bool
):
    found = rules(changed(problem, closures=[closure]), plan)

    assert found == ({"closed"} if is_refused else set())


def zone_over(longitude_deg: float, **dates: str) -> Mapping[str, Any]:
    west, east = longitude_deg - 0.001, longitude_deg + 0.001
    ring = [[west, -1], [east, -1], [east, 1], [west, 1], [west, -1]]
    return {
        "type": "Feature",
        "geometry": {"type": "Polygon", "coordinates": [ring]},
        "properties": {"kind": "zone", "zone_id": "z", **dates},
    }


@pytest.mark.parametrize(
    ("zone", "is_refused"),
    [
        (zone_over(0.015), True),  # between b and c
        (zone_over(0.5), False),
        (zone_over(0.015, active_from="2026-01-01T00:26:40Z"), False),  # 1600 s: just over
        (zone_over(0.015, active_from="2026-01-01T00:26:39Z"), True),
        (zone_over(0.015, active_until="2026-01-01T00:18:20Z"), False),  # 1100 s: just before
        (zone_over(0.015, active_until="2026-01-01T00:18:21Z"), True),
    ],
)
def test_crossing_a_zone_while_it_is_active_is_caught(problem, plan, zone, is_refused: bool):
    document = problem.model_dump(mode="json", by_alias=True)
    document["network"]["features"].append(zone)
    document["start_at"] = "2026-01-01T00:00:00Z"

    found = rules(Problem.model_validate(document), plan)

    assert found == ({"closed"} if is_refused else set())


def test_waiting_before_a_hand_over_is_caught(make_problem):
    problem = make_problem("a-b:1", "b")
    plan = compose(problem)
    flown, delivered = plan.steps[1:]
    wait = {"kind": "WAIT", "station_id": "b", "start_s": 100.0, "end_s": 160.0}
    late = delivered.model_copy(update={"start_s": 160.0, "end_s": 160.0})

    waiting = Plan.model_validate({**dict(plan), "steps": [plan.steps[0], flown, wait, late]})

    assert "hand-over" in rules(problem, waiting)


def test_a_finish_out_of_reach_of_any_pad_is_caught(make_problem):
    network, pads = "a-b:8", {"b": 0}
    plan = compose(make_problem(network, "b", pads=pads, finish="stay"))

    assert rules(make_problem(network, "b", pads=pads), plan) == {"finish"}


def test_a_session_that_stops_short_breaks_the_full_policy(problem, plan):
    assert rules(changed(problem, recharge_policy="full"), plan) == {"policy"}


def test_a_plan_that_is_late_is_caught(problem, plan):
    late = changed(problem, latest_delivery_s=plan.delivery_time_s - 0.01)

    assert rules(late, plan) == {"latest_delivery_s"}


def test_a_lower_bound_above_the_plan_is_caught(problem, plan):
    bound_s = plan.delivery_time_s + 1.0

    assert rules(problem, plan.model_copy(update={"lower_bound_s": bound_s})) == {"lower_bound_s"}


def test_a_landing_whose_cost_was_forgotten_is_caught(problem, plan, model):
    model = model.model_copy(update={"stop_s": 5.0})

    assert "duration" in rules(changed(problem, drone={"model": model, "soc": 1.0}), plan)


@pytest.mark.parametrize("status", ["infeasible", "unknown"])
def test_a_plan_without_flights_shows_no_times(problem, plan, status: str):
    assert rules(problem, plan.model_copy(update={"status": status})) == {"no plan"}


def test_an_infeasible_plan_must_name_its_reason(problem):
    assert rules(problem, Plan(status="infeasible")) == {"no plan"}
    assert verify(problem, Plan(status="unknown")) == ()
