"""Requests share trips if they allow it, and a shared trip keeps the promises of all."""

import pytest

from skyway.delivery.plan import PickUp
from skyway.dispatch.check import violations
from skyway.dispatch.optimise import optimise
from skyway.dispatch.pools import waits_for_more
from skyway.dispatch.problem import FleetProblem
from skyway.geo import Position
from skyway.ids import StationId
from skyway.network.network import Network
from skyway.network.parts import Segment, Station
from tests.library.dispatch.fleets import MODEL, delivered, small_fleet, without_promises


def at_one_hub(*, pooling: bool) -> FleetProblem:
    fleet = small_fleet(4, drones=2, requests=6)
    source = fleet.requests[0].source
    requests = [
        each.model_copy(update={"source": source, "pooling": pooling, "promised_s": None})
        for each in fleet.requests
    ]
    return fleet.model_copy(update={"requests": tuple(requests)})


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
    assert "not loaded at a common pickup of its requests" in violations(far, plan)[0]


@pytest.mark.parametrize("urgent", ["b", "c"])
def test_a_shared_trip_stops_first_where_another_order_would_break_a_promise(urgent: str) -> None:
    """Both orders of the stops end at the same moment."""
    names = tuple(StationId(name) for name in "abc")
    network = Network(
        {name: Station(name, Position(0.0, 0.0), pads=1) for name in names},
        [Segment(one, other, 6_000.0) for one in names for other in names if one != other],
    )
    problem = FleetProblem.model_validate(
        {
            "network": network,
            "drones": [{"drone_id": "d", "model": MODEL, "station_id": "a", "soc": 1.0}],
            "requests": [
                {
                    "request_id": end,
                    "source": "a",
                    "packages": [{"package_id": end, "mass_kg": 0.5, "destination": end}],
                    "pooling": True,
                    "known_s": -60.0 if end == urgent else 0.0,
                    "promised_s": 500.0 if end == urgent else None,
                }
                for end in "bc"
            ],
            "promise_tolerance_s": 0.0,
        }
    )

    plan = optimise(problem, rounds=2)

    assert len(plan.trips) == 1
    assert delivered(plan)[urgent] <= 500.0


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
