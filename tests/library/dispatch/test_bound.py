"""Compares the lower bound with the best of all plans, on very small fleets."""

from collections.abc import Iterator, Sequence
from itertools import permutations

import pytest

from skyway.dispatch.optimise import optimise
from skyway.dispatch.problem import FleetProblem
from skyway.dispatch.schedule import Scheduler, Sequences
from tests.library.dispatch.fleets import small_fleet


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


def all_sequences(scheduler: Scheduler) -> Iterator[Sequences]:
    """Every order of every allowed grouping of the requests, over two drones."""
    requests = scheduler.problem.requests
    for pools in groups(range(len(requests))):
        is_allowed = all(
            len(pool) == 1
            or (
                all(requests[each].pooling for each in pool)
                and len({requests[each].source for each in pool}) == 1
            )
            for pool in pools
        )
        if is_allowed:
            for order in permutations(pools):
                for cut in range(len(order) + 1):
                    yield order[:cut], order[cut:]


def without_promises(problem: FleetProblem) -> FleetProblem:
    requests = [each.model_copy(update={"promised_s": None}) for each in problem.requests]
    return problem.model_copy(update={"requests": tuple(requests)})


@pytest.mark.parametrize("seed", range(8))
def test_the_bound_is_below_the_best_of_all_plans_and_the_search_is_near(seed: int) -> None:
    problem = without_promises(small_fleet(seed, drones=2, requests=4))
    scheduler = Scheduler(problem)

    best_s = min(scheduler.planned(each).costs.total_s for each in all_sequences(scheduler))
    plan = optimise(problem, rounds=5, seed=seed, proves=True)

    assert best_s * 0.9999 <= plan.costs.total_s <= best_s * 1.05
    assert plan.lower_bound_s is not None
    assert 0 < plan.lower_bound_s <= best_s + 0.1
