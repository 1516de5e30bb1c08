"""The heuristic and its recharge rule, tested by the steps of their plans."""

import pytest

from skyway.delivery.plan import Deliver, Fly, Plan, Recharge, Wait
from skyway.planner import compose
from skyway.planner.problem import Problem


def words_of(plan: Plan) -> list[str]:
    """The plan in words: where it flies, waits, recharges (pad, until), delivers."""
    words = []
    for step in plan.steps:
        if isinstance(step, Fly):
            words.append(f"fly {step.to_id}")
        elif isinstance(step, Wait):
            words.append(f"wait {step.end_s - step.start_s:.0f}")
        elif isinstance(step, Recharge):
            words.append(f"recharge {step.soc_end:.2f}")
        elif isinstance(step, Deliver):
            words.append(f"deliver {step.station_id}")
    return words


def planned(problem: Problem) -> Plan:
    return compose(problem.model_copy(update={"strategy": "heuristic"}))


def test_it_flies_over_stations_while_the_next_pad_is_in_reach(make_problem):
    plan = planned(make_problem("a-b:4 b-c:4", "c"))

    assert words_of(plan) == ["fly b", "fly c", "deliver c"]
    assert plan.delivery_time_s == 800.0


def test_under_the_partial_policy_it_recharges_only_to_reach_the_next_pad(make_problem):
    plan = planned(make_problem("a-b:8 b-c:5", "c"))

    assert words_of(plan) == ["fly b", "recharge 0.50", "fly c", "deliver c"]
    assert plan.delivery_time_s == pytest.approx(800 + 300 + 500)


def test_under_the_full_policy_it_recharges_to_the_top(make_problem):
    plan = planned(make_problem("a-b:8 b-c:5", "c", recharge_policy="full"))

    assert words_of(plan) == ["fly b", "recharge 1.00", "fly c", "deliver c"]
    assert plan.delivery_time_s == pytest.approx(800 + 800 + 500)


def test_it_recharges_early_where_the_next_station_has_no_pad(make_problem):
    plan = planned(make_problem("a-b:6 b-c:3 c-d:5", "d", pads={"c": 0}))

    assert words_of(plan) == ["fly b", "recharge 0.80", "fly c", "fly d", "deliver d"]


def test_it_makes_a_detour_to_a_pad_where_the_shortest_path_has_none(make_problem):
    network = "a-b:6 b-c:6 a-p:5 p-q:5 q-c:5"

    plan = planned(make_problem(network, "c", pads={"b": 0}))

    assert [word for word in words_of(plan) if "fly" in word] == ["fly p", "fly q", "fly c"]


def test_it_turns_back_to_a_pad_if_there_is_no_other_way(make_problem):
    plan = planned(make_problem("a-b:6 b-p:2 b-c:6", "c", pads={"b": 0}))

    flights = [word for word in words_of(plan) if "fly" in word]
    assert flights == ["fly b", "fly p", "fly b", "fly c"]


def test_it_keeps_enough_to_reach_a_pad_after_a_delivery_without_one(make_problem):
    plan = planned(make_problem("a-b:6 b-c:4", "c", soc=0.7, pads={"c": 0}))

    recharging_at_b = ["fly b", "recharge 0.80", "fly c", "deliver c"]
    assert words_of(plan) in (recharging_at_b, ["recharge 1.00", *recharging_at_b])


def test_with_the_finish_stay_it_may_end_empty(make_problem):
    plan = planned(make_problem("a-b:6 b-c:4", "c", pads={"c": 0}, finish="stay"))

    assert words_of(plan) == ["fly b", "fly c", "deliver c"]


def test_it_waits_for_a_pad_when_all_are_taken(make_problem, taken):
    plan = planned(make_problem("a-b:8 b-c:5", "c", pad_reservations=taken("b", 0, 1000)))

    assert words_of(plan) == ["fly b", "wait 200", "recharge 0.50", "fly c", "deliver c"]
    assert plan.waiting_s == pytest.approx(200.0)


def test_it_recharges_elsewhere_if_a_station_is_congested(make_problem, taken):
    network = "a-b:5 b-c:4 c-d:5"

    plan = planned(make_problem(network, "d", pad_reservations=taken("c", 0, 5000)))

    assert words_of(plan) == ["fly b", "recharge 0.90", "fly c", "fly d", "deliver d"]


def test_it_takes_another_path_around_a_congested_station(make_problem, taken):
    network = "a-b:8 b-d:8 a-c:9 c-d:9"

    plan = planned(make_problem(network, "d", pad_reservations=taken("b", 0, 5000)))

    assert words_of(plan) == ["fly c", "recharge 0.90", "fly d", "deliver d"]


def test_it_waits_on_the_ground_until_a_segment_opens(make_problem):
    closures = [{"from": "b", "to": "c", "start_s": 0, "end_s": 1000}]

    plan = planned(make_problem("a-b:4 b-c:4", "c", closures=closures))

    assert words_of(plan) == ["wait 600", "fly b", "fly c", "deliver c"]


def test_it_takes_another_path_if_a_segment_closes_for_good_during_the_flight(make_problem):
    closures = [{"from": "b", "to": "d", "start_s": 500, "end_s": None}]

    plan = planned(make_problem("a-b:4 b-d:4 a-c:5 c-d:5", "d", closures=closures))

    assert words_of(plan) == ["fly c", "fly d", "deliver d"]


def test_it_does_not_land_at_a_closed_station_but_flies_over_it(make_problem):
    network = "a-b:4 b-c:2 c-d:6"
    closures = [{"station_id": "c", "start_s": 0}]

    plan = planned(make_problem(network, "d", closures=closures))

    assert words_of(plan) == ["fly b", "recharge 0.80", "fly c", "fly d", "deliver d"]


def test_it_delivers_in_the_best_order(make_problem):
    plan = planned(make_problem("a-b:1 b-c:3 a-c:5 c-d:1", "d", "c", "b"))

    assert [word for word in words_of(plan) if "deliver" in word] == [
        "deliver b",
        "deliver c",
        "deliver d",
    ]


def test_a_heavier_load_is_slower_and_needs_more_energy(make_problem, model):
    model = model.model_copy(update={"speed_full_mps": 5.0})
    packages = [
        {"package_id": "p1", "mass_kg": 0.6, "destination": "b"},
        {"package_id": "p2", "mass_kg": 0.4, "destination": "c"},
    ]

    plan = planned(make_problem("a-b:1 b-c:1", model=model, packages=packages))

    flights = [step for step in plan.steps if isinstance(step, Fly)]
    assert [flight.load_kg for flight in flights] == pytest.approx([1.0, 0.4])
    assert [flight.end_s - flight.start_s for flight in flights] == pytest.approx([200.0, 125.0])
    assert flights[0].energy_j == pytest.approx(200 * 100 * 2**1.5)


def test_landings_cost_their_time_and_energy_and_flying_over_costs_nothing(make_problem, model):
    model = model.model_copy(update={"stop_s": 30.0, "stop_j": 1000.0})

    plan = planned(make_problem("a-b:4 b-c:4", "c", model=model))

    flights = [step for step in plan.steps if isinstance(step, Fly)]
    assert [flight.end_s - flight.start_s for flight in flights] == pytest.approx([400.0, 430.0])
    assert plan.energy_j == pytest.approx(81_000.0)


def test_it_approaches_from_another_station_and_loads_there(make_problem):
    plan = planned(
        make_problem(
            "z-y:8 y-a:5 a-b:4", "b", "a", station="z", loading_s=60, dropoff_s=20, soc=0.9
        )
    )

    assert [step.kind for step in plan.steps] == [
        "FLY",
        "RECHARGE",
        "FLY",
        "PICK_UP",
        "DELIVER",
        "RECHARGE",
        "FLY",
        "DELIVER",
    ]
    assert plan.delivery_time_s == pytest.approx(800 + 400 + 500 + 60 + 20 + 400 + 400 + 20)


def test_packages_for_the_source_are_handed_over_right_after_loading(make_problem):
    plan = planned(make_problem("a-b:1", "a", loading_s=60, dropoff_s=20))

    assert [step.kind for step in plan.steps] == ["PICK_UP", "DELIVER"]
    assert plan.delivery_time_s == 80.0


def test_a_plan_later_than_the_requested_time_is_no_plan(make_problem, taken):
    problem = make_problem("a-b:8 b-c:5", "c", pad_reservations=taken("b", 0, 5000))
    assert planned(problem).status == "feasible"

    late = planned(problem.model_copy(update={"latest_delivery_s": 3000.0}))

    assert (late.status, late.steps) == ("unknown", ())


def test_a_label_limit_always_ends_the_search_at_the_same_place(make_problem):
    problem = make_problem("a-b:4 b-c:4 c-d:4 b-d:5", "c", "d", label_limit=2)

    first, second = planned(problem), planned(problem)

    assert first.status == "unknown"
    assert first.stats["labels"] == second.stats["labels"] <= 3
