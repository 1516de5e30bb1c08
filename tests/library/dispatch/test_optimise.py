"""Fleet plans over many random small fleets: valid, never worse than arrival order, repeatable."""

import json
from collections import Counter
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from skyway.delivery.plan import PickUp, Recharge
from skyway.dispatch.check import violations
from skyway.dispatch.optimise import optimise
from skyway.dispatch.plan import FleetPlan
from skyway.dispatch.pools import waits_for_more
from skyway.dispatch.problem import CurrentTrip, FleetProblem, read_fleet_problem
from skyway.errors import InvalidProblem
from skyway.network.network import Network
from tests.library.dispatch.fleets import small_fleet, with_pickups, without_promises

SEEDS = st.integers(min_value=0, max_value=10_000)


def arrival_order(problem: FleetProblem) -> FleetPlan:
    return optimise(problem, rounds=0)


def delivered(plan: FleetPlan) -> dict[str, float]:
    return {one.request_id: one.delivered_s for each in plan.trips for one in each.requests}


@settings(max_examples=15)
@given(SEEDS, st.sampled_from(["none", "requests"]), st.booleans())
def test_a_plan_is_valid_and_never_worse_than_the_arrival_order(
    seed: int, fairness: str, has_pickups: bool
) -> None:
    problem = small_fleet(seed, drones=3, requests=6, fairness=fairness)
    if has_pickups:
        problem = with_pickups(problem, seed)

    first, plan = arrival_order(problem), optimise(problem, rounds=3, seed=seed, proves=True)

    assert violations(problem, plan) == violations(problem, first) == ()
    assert plan.arrival_order == first.costs
    assert plan.costs.total_s <= first.costs.total_s
    assert plan.lower_bound_s is not None
    assert plan.lower_bound_s <= plan.costs.total_s
    came, comes = delivered(first), delivered(plan)
    for request in problem.requests:
        if request.promised_s is not None and request.request_id in came:
            latest_s = max(request.promised_s, came[request.request_id])
            assert comes[request.request_id] <= latest_s + problem.promise_tolerance_s
    if fairness == "requests":
        owner = {each.drone_id: each.provider_id for each in problem.drones}
        flown, before = (
            Counter(owner[each.drone_id] for each in one.trips for _ in each.requests)
            for one in (plan, first)
        )
        assert all(flown[each] >= before[each] for each in before)


@settings(max_examples=5)
@given(SEEDS)
def test_drones_of_different_connectors_charge_on_pads_that_fit_them(seed: int) -> None:
    fleet = small_fleet(seed, drones=3, requests=6)
    names = ("blade", "pin")
    stations = {
        name: replace(each, properties={"pad_connectors": [names[number % 2]]})
        for number, (name, each) in enumerate(fleet.network.stations.items())
    }
    drones = tuple(
        each.model_copy(
            update={
                "model": each.model.model_copy(
                    update={"model_id": f"m{number}", "connector": names[number % 2]}
                )
            }
        )
        for number, each in enumerate(fleet.drones)
    )
    network = Network(stations, fleet.network.segments)
    mixed = fleet.model_copy(update={"network": network, "drones": drones})

    plan = optimise(mixed, rounds=2, seed=seed, proves=True)

    assert violations(mixed, plan) == ()
    connector_of = {each.drone_id: each.model.connector for each in mixed.drones}
    for trip in plan.trips:
        for step in trip.plan.steps:
            if isinstance(step, Recharge):
                fitting = stations[step.station_id].properties["pad_connectors"]
                assert connector_of[trip.drone_id] in fitting
    assert plan.lower_bound_s is not None
    assert plan.lower_bound_s <= plan.costs.total_s


@settings(max_examples=10)
@given(SEEDS)
def test_no_plan_but_the_current_plan_breaks_a_promise(seed: int) -> None:
    fleet = small_fleet(seed, drones=3, requests=6)
    first = arrival_order(fleet)
    came = delivered(first)
    planned = {
        one.request_id: CurrentTrip(drone_id=each.drone_id, start_s=each.start_s)
        for each in first.trips
        for one in each.requests
    }
    requests = tuple(
        each.model_copy(
            update={
                "planned": planned.get(each.request_id),
                "promised_s": came.get(each.request_id),
            }
        )
        for each in fleet.requests
    )
    update = {"requests": requests, "baseline": "current plan", "promise_tolerance_s": 60.0}
    problem = fleet.model_copy(update=update)

    plan = optimise(problem, rounds=3, seed=seed)

    assert plan.costs.total_s <= first.costs.total_s
    for request_id, delivered_s in delivered(plan).items():
        assert delivered_s <= came.get(request_id, delivered_s) + 60.0


@settings(max_examples=8)
@given(SEEDS)
def test_windows_closures_and_taken_pads_are_kept(seed: int) -> None:
    fleet = small_fleet(seed, drones=2, requests=4)
    stations = list(fleet.network.stations)
    windowed = fleet.requests[0].model_copy(
        update={"pickup_not_before_s": 1_200.0, "pickup_latest_s": 9_000.0}
    )
    problem = FleetProblem.model_validate(
        {
            **dict(fleet),
            "requests": (windowed, *fleet.requests[1:]),
            "closures": [{"station_id": stations[0], "start_s": 600.0, "end_s": 2_400.0}],
            "pad_reservations": [
                {"station_id": each, "pad": 0, "start_s": 0.0, "end_s": 1_800.0}
                for each in stations[:4]
            ],
        }
    )

    plan = optimise(problem, rounds=3, seed=seed)

    assert violations(problem, plan) == ()
    assert plan.costs.total_s <= plan.arrival_order.total_s


def test_the_same_seed_gives_the_same_plan() -> None:
    problem = small_fleet(1, drones=3, requests=7)

    plans = [optimise(problem, rounds=4, seed=5) for _ in range(2)]

    assert plans[0] == plans[1]


def test_requests_with_one_pick_up_share_trips_only_if_they_allow_it() -> None:
    problem = at_one_hub(pooling=True)

    shared, alone = optimise(problem, rounds=3), optimise(at_one_hub(pooling=False), rounds=3)

    assert violations(problem, shared) == ()
    assert len(shared.trips) < len(problem.requests) == len(alone.trips)
    assert shared.costs.total_s < alone.costs.total_s
    assert violations(at_one_hub(pooling=False), shared) != ()


def test_requests_of_different_stations_share_a_trip_from_a_station_where_all_hand_over() -> None:
    fleet = small_fleet(4, drones=2, requests=6)
    taken = {one.destination for each in fleet.requests for one in each.packages}
    hub, *others = [each for each in fleet.network.stations if each not in taken]
    requests = [
        each.model_copy(
            update={"source": others[number % len(others)], "pickups": (hub,), "pooling": True}
        )
        for number, each in enumerate(fleet.requests)
    ]
    problem = without_promises(fleet.model_copy(update={"requests": tuple(requests)}))
    far = problem.model_copy(
        update={"requests": tuple(each.model_copy(update={"pickups": ()}) for each in requests)}
    )

    plan = optimise(problem, rounds=3, proves=True)

    loaded = {
        step.station_id: len(each.requests)
        for each in plan.trips
        for step in each.plan.steps
        if isinstance(step, PickUp)
    }
    assert loaded[hub] > 1
    assert violations(problem, plan) == ()
    assert "not loaded at a common pick-up of its requests" in violations(far, plan)[0]


def test_a_check_finds_a_pad_and_a_drone_that_are_used_twice() -> None:
    problem = small_fleet(3, drones=3, requests=6)
    plan = optimise(problem, rounds=1)
    late = plan.trips[0].model_copy(update={"start_s": plan.trips[0].start_s + 60.0})
    held = next(
        (each, step)
        for each in plan.trips
        for step in each.plan.steps
        if isinstance(step, Recharge)
    )
    trip, session = held
    taken = {
        "station_id": session.station_id,
        "pad": session.pad,
        "start_s": trip.start_s + session.start_s,
        "end_s": trip.start_s + session.end_s,
    }
    beset = FleetProblem.model_validate({**dict(problem), "pad_reservations": [taken]})

    assert (
        "the drone is free at"
        in violations(problem, plan.model_copy(update={"trips": (late, *plan.trips[1:])}))[0]
    )
    assert any("pad" in each for each in violations(beset, plan))


def test_a_request_that_no_drone_can_fly_is_named_with_its_reason() -> None:
    fleet = small_fleet(2, drones=2, requests=2)
    heavy = fleet.requests[0].packages[0].model_copy(update={"mass_kg": 50.0})
    request = fleet.requests[0].model_copy(update={"packages": (heavy,)})
    problem = fleet.model_copy(update={"requests": (request, fleet.requests[1])})

    plan = optimise(problem, rounds=2, proves=True)

    assert [(each.request_id, each.code) for each in plan.unserved] == [("r0", "OVERWEIGHT")]
    assert violations(problem, plan) == ()


def test_the_current_plan_is_kept_where_moves_cost_more_than_they_save() -> None:
    fleet = small_fleet(6, drones=3, requests=6, prices={"move_s": 1e6})
    first = optimise(fleet, rounds=3, seed=1)
    planned = {
        one.request_id: CurrentTrip(drone_id=each.drone_id, start_s=each.start_s)
        for each in first.trips
        for one in each.requests
    }
    again = fleet.model_copy(
        update={
            "requests": tuple(
                each.model_copy(update={"planned": planned[each.request_id]})
                for each in fleet.requests
            )
        }
    )

    plan = optimise(again, rounds=3, seed=2)

    assert plan.costs.moves == 0
    assert plan.costs.total_s <= first.costs.total_s + 1.0


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"drones": []}, "drones"),
        ({"surplus": 1}, "surplus"),
        ({"most_pooled": 9}, "most_pooled"),
        ({"prices": {"lateness": -1.0}}, "prices.lateness"),
        ({"pad_reservations": [{"station_id": "s1", "pad": 7, "start_s": 0.0}]}, "pad_reserv"),
    ],
)
def test_a_fault_of_a_document_names_its_field(change: dict[str, object], field: str) -> None:
    document = {**json.loads(small_fleet(1).model_dump_json()), **change}

    with pytest.raises(InvalidProblem) as refused:
        read_fleet_problem(document)

    assert refused.value.field.startswith(field)


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({"pickups": ["nowhere"], "pooling": True}, "no station 'nowhere'"),
        ({"pickups": ["SOURCE"], "pooling": True}, "is the source"),
        ({"pickups": ["OTHER", "OTHER"], "pooling": True}, "given twice"),
        ({"pickups": ["OTHER"], "pooling": False}, "need pooling"),
    ],
)
def test_a_fault_of_other_pick_ups_is_named(changes: dict[str, Any], fault: str) -> None:
    document = json.loads(small_fleet(1).model_dump_json())
    request = document["requests"][0]
    taken = {request["source"], *(each["destination"] for each in request["packages"])}
    stations = [each["properties"].get("station_id") for each in document["network"]["features"]]
    names = {
        "SOURCE": request["source"],
        "OTHER": next(each for each in stations if each and each not in taken),
    }
    pickups = [names.get(each, each) for each in changes["pickups"]]
    document["requests"][0] |= {**changes, "pickups": pickups}

    with pytest.raises(InvalidProblem, match=fault) as refused:
        read_fleet_problem(document)

    assert refused.value.field.startswith("requests.0.pickups")


def at_one_hub(*, pooling: bool) -> FleetProblem:
    fleet = small_fleet(4, drones=2, requests=6)
    source = fleet.requests[0].source
    requests = [
        each.model_copy(update={"source": source, "pooling": pooling, "promised_s": None})
        for each in fleet.requests
    ]
    return fleet.model_copy(update={"requests": tuple(requests)})


def test_a_trip_waits_for_more_requests_until_it_is_full_or_its_oldest_request_is_old() -> None:
    fleet = small_fleet(1, requests=3, most_pooled=2)
    source = fleet.requests[0].source
    requests = tuple(
        each.model_copy(update={"pooling": number < 2, "known_s": known_s, "source": source})
        for number, (each, known_s) in enumerate(
            zip(fleet.requests, (-300.0, -100.0, 0.0), strict=True)
        )
    )
    problem = fleet.model_copy(update={"requests": requests})

    def waits(*pool: int) -> bool:
        return waits_for_more(problem, pool, most_wait_s=200.0)

    assert waits(1)
    assert not waits(0), "its request is old"
    assert not waits(0, 1), "it is full"
    assert not waits(2), "its request may not share a trip"
