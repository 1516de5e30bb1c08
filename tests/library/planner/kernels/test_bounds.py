"""The least that follows, over all orders of the rest, beside all orders tried one by one."""

from itertools import pairwise, permutations

import numpy as np
import pytest

from skyway.planner.kernels.bounds import fill_orders


@pytest.mark.parametrize("seed", range(20))
def test_the_least_time_over_all_orders_is_the_time_of_the_best_order(seed: int) -> None:
    random = np.random.default_rng(seed)
    count = int(random.integers(1, 6))
    apart_m = random.uniform(1, 100, (count + 1, count))
    apart_m[random.random(apart_m.shape) < 0.15] = np.inf
    weight = random.uniform(0.1, 1.0, (1 << count) + 1)
    at_end = random.uniform(0, 50, count)
    required = np.zeros(count, np.int32)
    if count > 1 and seed % 2:
        required[0] = 2
    after = np.empty((1 << count, count))

    least = fill_orders(apart_m, required, weight, 7.0, at_end, after)

    def total(order: tuple[int, ...]) -> float:
        if required[0] and order.index(0) < order.index(1):
            return np.inf
        mask, sum_s = 0, 0.0
        for before, reached in pairwise((count, *order)):
            sum_s += apart_m[before, reached] * weight[mask] + 7.0
            mask |= 1 << reached
        return sum_s + float(at_end[order[-1]])

    assert least == pytest.approx(min(total(order) for order in permutations(range(count))))
