"""Compares the lower bound with the best of all plans, on very small fleets."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import permutations, product

import pytest

from skyway.dispatch import estimates
from skyway.dispatch.optimise import begun, optimise, proven_s, searched
from skyway.dispatch.pools import pickups_of
from skyway.dispatch.problem import FleetProblem
from skyway.dispatch.schedule import Schedule, Scheduler
from skyway.ids import StationId
from skyway.planner.problem_parts import PackageToDeliver
from tests.library.dispatch.fleets import (
    MODEL,
    city,
    small_fleet,
    with_pickups,
    without_promises,
)


def groups(items: Sequence[int]) -> Iterator[list[tuple[int, ...]]]:
    """All ways to put these items into groups."""
    if not items:
        yield []
        return
    first, *others = items
    for smaller in groups(others):
        yield [(first,), *smaller]
        for number, group in enumerate(smaller):
            yield [*smaller[:number], (first, *group), *smaller[number + 1 :]]


def all_schedules(problem: FleetProblem) -> Iterator[Schedule]:
    """Every order of every allowed grouping of the requests from every pickup, on two drones."""
    requests = problem.requests
    for pools in groups(range(len(requests))):
        members = [[requests[each] for each in pool] for pool in pools]
        if not all(len(each) == 1 or all(one.pooling for one in each) for each in members):
            continue
        for pickups in product(*map(pickups_of, members)):
            loaded = loaded_at(problem, dict(zip(pools, pickups, strict=True)))
            scheduler = Scheduler(loaded)
            for order in permutations(pools):
                for cut in range(len(order) + 1):
                    found = scheduler.planned((order[:cut], order[cut:]))
                    if all(is_allowed(problem, loaded, each.trip.pool) for each in found.trips):
                        yield found


def is_allowed(problem: FleetProblem, loaded: FleetProblem, pool: tuple[int, ...]) -> bool:
    """Whether the trip is loaded where it may be: a group may have no plan, and be split."""
    pickups = pickups_of([problem.requests[each] for each in pool])
    return loaded.requests[pool[0]].source in pickups


def loaded_at(problem: FleetProblem, pickups: Mapping[tuple[int, ...], StationId]) -> FleetProblem:
    """The problem in which each group of requests has this pickup only."""
    source_of = {number: pickup for pool, pickup in pickups.items() for number in pool}
    requests = [
        each.model_copy(update={"source": source_of[number], "pickups": ()})
        for number, each in enumerate(problem.requests)
    ]
    return problem.model_copy(update={"requests": tuple(requests)})


# In the fleet of seed 83, a shared trip serves a request sooner than a trip from its source.
@pytest.mark.parametrize(
    ("seed", "has_pickups"),
    [*((each, False) for each in range(8)), *((each, True) for each in (*range(7), 83))],
)
def test_the_bound_is_below_the_best_of_all_plans_and_the_search_is_near(
    seed: int, has_pickups: bool
) -> None:
    problem = without_promises(small_fleet(seed, drones=2, requests=4))
    if has_pickups:
        problem = with_pickups(problem, seed)

    best_s = min(each.costs.total_s for each in all_schedules(problem))
    plan = optimise(problem, rounds=5, seed=seed, proves=True)

    assert best_s * 0.9999 <= plan.costs.total_s <= best_s * 1.05
    assert plan.lower_bound_s is not None
    assert 0 < plan.lower_bound_s <= best_s + 0.1
    # A bound is never above the best plan that is known, so it is also proven from a worse plan.
    assert 0 < proven_s(begun(problem, seed=seed)) <= best_s + 0.1


@pytest.mark.parametrize("seed", range(12))
def test_the_bound_holds_if_all_orders_of_a_trip_count_as_one(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As the orders of trips with more than four destinations do."""
    problem = with_pickups(without_promises(small_fleet(seed, drones=2, requests=3)), seed)
    best_s = min(each.costs.total_s for each in all_schedules(problem))

    monkeypatch.setattr(estimates, "MOST_ORDERED", 0)

    assert 0 < proven_s(begun(problem, seed=seed)) <= best_s + 0.1


def test_a_fleet_is_proven_whose_request_has_twelve_destinations() -> None:
    problem = without_promises(small_fleet(1, drones=2, requests=2, network=city(1, stations=16)))
    first, *others = problem.requests
    stations = [each for each in problem.network.stations if each != first.source]
    packages = tuple(
        PackageToDeliver(package_id=f"p{number}", mass_kg=0.01, destination=each)
        for number, each in enumerate(stations[:12])
    )
    many = first.model_copy(update={"packages": packages})
    problem = problem.model_copy(update={"requests": (many, *others)})

    plan = optimise(problem, rounds=20, proves=True)

    assert plan.lower_bound_s is not None
    assert 0 < plan.lower_bound_s <= plan.costs.total_s + 0.1


def test_a_weaker_bound_is_given_if_not_all_shared_trips_are_estimated() -> None:
    search = searched(without_promises(small_fleet(2, drones=2, requests=6)), rounds=2)
    known_s = proven_s(search)

    search.board.has_all_pools = False

    assert 0 < proven_s(search) < known_s


def test_no_bound_is_claimed_if_a_load_makes_a_drone_faster() -> None:
    """Then a shared trip may serve a request sooner than a trip for this request alone."""
    problem = without_promises(small_fleet(17, drones=2, requests=3))
    model = MODEL.model_copy(update={"speed_empty_mps": 8.0, "speed_full_mps": 20.0})
    drones = tuple(each.model_copy(update={"model": model}) for each in problem.drones)
    problem = problem.model_copy(update={"drones": drones})

    best_s = min(each.costs.total_s for each in all_schedules(problem))

    assert 0 <= proven_s(searched(problem, rounds=1)) <= best_s
