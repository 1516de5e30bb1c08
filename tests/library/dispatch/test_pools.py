"""Which requests may share a trip: all sets if they are few, else the best of each size."""

from itertools import combinations
from random import Random

import pytest

from skyway.dispatch.estimates import Estimates
from skyway.dispatch.optimise import optimise
from skyway.dispatch.planned_trip import Pool
from skyway.dispatch.pools import Sharing, pickups_of
from skyway.dispatch.problem import CurrentTrip, FleetProblem
from skyway.dispatch.trips import TripPlanner
from skyway.geo import distance_m
from skyway.ids import StationId
from skyway.planner.kernels.fleet_trips import SECONDS
from tests.library.dispatch.fleets import MODEL, small_fleet, with_pickups


def may_share(problem: FleetProblem, pool: Pool) -> bool:
    members = [problem.requests[each] for each in pool]
    ends = {one.destination for each in members for one in each.packages}
    return (
        all(each.pooling for each in members)
        and bool(pickups_of(members))
        and sum(each.mass_kg for each in members) <= MODEL.max_payload_kg
        and len(ends) <= 6
    )


def at_hubs(requests: int, *, hubs: int, seed: int = 1) -> FleetProblem:
    """All requests come from some hubs, and may share trips."""
    fleet = small_fleet(seed, requests=requests)
    random = Random(seed)
    sources = list(fleet.network.stations)[:hubs]
    changed = [
        each.model_copy(
            update={"source": random.choice(sources), "pooling": True, "promised_s": None}
        )
        for each in fleet.requests
    ]
    return fleet.model_copy(update={"requests": tuple(changed)})


@pytest.mark.parametrize("seed", range(5))
def test_all_sets_that_may_share_a_trip_are_found_if_they_are_few(seed: int) -> None:
    problem = with_pickups(small_fleet(seed, requests=12, most_pooled=4), seed)

    found = Sharing(problem).pools()

    assert found.is_complete
    assert found.pools == [
        pool
        for size in (2, 3, 4)
        for pool in combinations(range(12), size)
        if may_share(problem, pool)
    ]


def test_if_sets_are_too_many_each_size_keeps_a_part_and_each_request_its_best() -> None:
    problem = at_hubs(30, hubs=2)
    all_pools = Sharing(problem).pools().pools

    found = Sharing(problem).pools(most_trips=120)

    sizes = [len(each) for each in found.pools]
    assert not found.is_complete
    assert sizes.count(2) == sizes.count(3) == 60
    assert set(found.pools) <= set(all_pools)
    of_pairs = {each for pool in all_pools if len(pool) == 2 for each in pool}
    assert of_pairs == {each for pool in found.pools if len(pool) == 2 for each in pool}


def test_the_search_tries_the_three_common_pickups_nearest_to_the_destinations() -> None:
    problem = with_pickups(small_fleet(3, requests=2), 3)
    one, other = problem.requests
    taken = {each.destination for request in (one, other) for each in request.packages}
    pickups = tuple(each for each in problem.network.stations if each not in taken)
    requests = tuple(
        each.model_copy(update={"source": pickups[0], "pickups": pickups[1:], "pooling": True})
        for each in (one, other)
    )
    problem = problem.model_copy(update={"requests": requests})

    found = Sharing(problem).pickups((0, 1))

    def away_m(station_id: StationId) -> float:
        stations = problem.network.stations
        ends = {
            number: {each.destination for each in requests[number].packages} for number in (0, 1)
        }
        here = stations[station_id].position
        return sum(
            distance_m(here, stations[each].position) for one in ends.values() for each in one
        )

    assert found == tuple(sorted(pickups, key=away_m)[:3])


def test_a_shared_trip_of_the_current_plan_is_kept_only_if_its_requests_may_share_it() -> None:
    problem = at_hubs(6, hubs=1)
    planned = [
        each.model_copy(
            update={
                "planned": CurrentTrip(drone_id=f"d{number // 3}", start_s=0.0),
                "pooling": number < 3,
                "packages": each.packages[:1],
            }
        )
        for number, each in enumerate(problem.requests)
    ]
    problem = problem.model_copy(update={"requests": tuple(planned), "baseline": "current plan"})

    pools = Sharing(problem).pools(most_trips=0).pools
    plan = optimise(problem, rounds=1)

    assert pools == [(0, 1, 2)]
    assert not plan.unserved


def test_requests_whose_masses_add_up_to_the_payload_may_share_a_trip() -> None:
    """As floats, 1.1 kg and 2.2 kg are more than 3.3 kg."""
    problem = at_hubs(2, hubs=1)
    model = MODEL.model_copy(update={"max_payload_kg": 3.3})
    requests = [
        each.model_copy(
            update={"packages": (each.packages[0].model_copy(update={"mass_kg": mass_kg}),)}
        )
        for each, mass_kg in zip(problem.requests, (1.1, 2.2), strict=True)
    ]
    drones = [each.model_copy(update={"model": model}) for each in problem.drones[:1]]
    problem = problem.model_copy(update={"requests": tuple(requests), "drones": tuple(drones)})

    plan = optimise(problem, rounds=1)

    assert Sharing(problem).pools().pools == [(0, 1)]
    assert [len(each.requests) for each in plan.trips] == [2]


@pytest.mark.parametrize("seed", [6, 22])
def test_no_estimate_serves_a_member_sooner_than_a_trip_that_serves_it_first(seed: int) -> None:
    problem = with_pickups(small_fleet(seed, requests=8), seed)
    planner = TripPlanner(problem)
    estimates = Estimates(problem, planner.models, sharing=planner.sharing)

    for pool in planner.sharing.pools().pools:
        trip = estimates.trip(0, pool)
        for early_s, (soonest_s, _) in zip(trip.early_s, estimates.soonest(0, pool), strict=True):
            assert soonest_s <= trip.best[SECONDS] - early_s + 1e-6
