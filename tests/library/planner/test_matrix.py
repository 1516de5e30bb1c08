from itertools import islice, pairwise, permutations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from skyway.planner.matrix import SOURCE, orders_by_cost


def total(order: tuple[int, ...], costs: dict[tuple[int, int], float]) -> float:
    return sum(costs[leg] for leg in pairwise((SOURCE, *order)))


@given(seed=st.randoms(use_true_random=False), destinations=st.integers(0, 4))
@settings(max_examples=50)
def test_all_orders_come_once_the_cheapest_first(seed, destinations: int):
    numbers = range(destinations)
    costs = {(at, to): seed.randint(1, 9) for at in (SOURCE, *numbers) for to in numbers}

    ranked = list(orders_by_cost(destinations, lambda at, to, _waiting: costs[at, to]))

    assert sorted(order for _, order in ranked) == sorted(permutations(numbers))
    assert [cost for cost, _ in ranked] == sorted(total(order, costs) for _, order in ranked)


def test_the_cost_of_a_leg_may_depend_on_the_remaining_destinations():
    def cost(at: int, to: int, waiting: int) -> float:
        return float(waiting.bit_count()) * (10.0 if to == 0 else 1.0)

    cheapest, order = next(orders_by_cost(2, cost))

    assert (cheapest, order) == (12.0, (1, 0))


def test_orders_with_an_impossible_leg_are_left_out():
    def cost(at: int, to: int, waiting: int) -> float:
        return float("inf") if (at, to) == (SOURCE, 0) else 1.0

    assert [order for _, order in orders_by_cost(2, cost)] == [(1, 0)]


@pytest.mark.parametrize("destinations", [12])
def test_the_first_orders_of_twelve_destinations_need_no_full_enumeration(destinations: int):
    ranked = orders_by_cost(destinations, lambda at, to, _waiting: float(abs(to - at)))

    assert [order for _, order in islice(ranked, 1)] == [tuple(range(12))]
