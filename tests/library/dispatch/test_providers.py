"""Requests are flown by drones of the providers that they name, which can carry their packages."""

from random import Random

import pytest
from skyway_lab.benchmarks.dispatch.small import all_schedules

from skyway.dispatch.best_order import BestOrder
from skyway.dispatch.check import violations
from skyway.dispatch.optimise import begun, optimise
from skyway.dispatch.problem import FleetProblem
from tests.library.dispatch.fleets import small_fleet


def limited(seed: int, **sizes: int) -> FleetProblem:
    """A fleet of two providers, in which most requests name one of them."""
    problem, random = small_fleet(seed, **sizes), Random(seed)
    choices = [None, ("provider-0",), ("provider-1",), ("provider-0", "provider-1")]
    requests = [
        each.model_copy(update={"provider_ids": random.choice(choices)})
        for each in problem.requests
    ]
    return problem.model_copy(update={"requests": tuple(requests)})


@pytest.mark.parametrize("seed", range(6))
def test_no_request_is_flown_by_a_provider_that_it_does_not_name(seed: int) -> None:
    problem = limited(seed, drones=4, requests=8)
    provider_of = {each.drone_id: each.provider_id for each in problem.drones}
    named = {each.request_id: each.provider_ids for each in problem.requests}

    plan = optimise(problem, rounds=3, proves=True)

    for trip in plan.trips:
        for one in trip.requests:
            allowed = named[one.request_id]
            assert allowed is None or provider_of[trip.drone_id] in allowed
    assert violations(problem, plan) == ()
    assert (plan.lower_bound_s or 0.0) <= plan.costs.total_s


@pytest.mark.parametrize("seed", range(3))
def test_a_request_goes_to_a_drone_that_carries_what_its_packages_need(seed: int) -> None:
    problem = small_fleet(seed, drones=4, requests=6)
    cold = ("FRAGILE", "UPRIGHT", "COLD")
    first, *others = problem.drones
    first = first.model_copy(update={"model": first.model.model_copy(update={"carries": cold})})
    requests = [
        each.model_copy(
            update={
                "packages": tuple(
                    one.model_copy(update={"handling": ("COLD",)}) for one in each.packages
                )
            }
        )
        if number < 2
        else each
        for number, each in enumerate(problem.requests)
    ]
    mixed = problem.model_copy(update={"drones": (first, *others), "requests": tuple(requests)})

    plan = optimise(mixed, rounds=3)

    assert plan.unserved == ()
    needing = {each.request_id for each in requests[:2]}
    drones = {
        trip.drone_id
        for trip in plan.trips
        if needing & {each.request_id for each in trip.requests}
    }
    assert drones == {first.drone_id}


@pytest.mark.parametrize("seed", range(6))
def test_no_order_of_drones_that_are_allowed_costs_less(seed: int) -> None:
    search = begun(limited(seed, drones=2, requests=3))
    tree = BestOrder(search.scheduler, search.limits)
    found = search.best
    while not tree.is_done:
        found = tree.step(found)

    best_s = min(each.costs.total_s for each in all_schedules(search))
    assert found.costs.total_s == pytest.approx(best_s, abs=0.01)


def test_a_check_finds_a_request_that_the_wrong_provider_flies() -> None:
    problem = small_fleet(1)
    plan = optimise(problem, rounds=1)
    requests = [each.model_copy(update={"provider_ids": ()}) for each in problem.requests]

    [first, *_] = violations(problem.model_copy(update={"requests": tuple(requests)}), plan)

    assert "its provider may not fly a request" in first
