"""Moves that the exact planner judges: what they keep, and what they find."""

import numpy as np
import pytest
from skyway_lab.benchmarks.dispatch.small import compared, small_fleet

from skyway.dispatch.optimise import begun
from skyway.dispatch.order_moves import Order, OrderMoves


def test_a_changed_order_has_every_request_at_most_once_and_no_pool_that_may_not_share() -> None:
    allowed = {(0, 1), (2, 3)}
    moves = OrderMoves(5, 3, allows=allowed.__contains__, draws=np.random.default_rng(1))
    order: Order = ((0, (0, 1)), (1, (2,)), (2, (3,)))

    for _ in range(2_000):
        order = moves.changed(order)

        served = [number for _, pool in order for number in pool]
        assert len(served) == len(set(served))
        assert {drone for drone, _ in order} <= {0, 1, 2}
        assert all(len(pool) == 1 or pool in allowed for _, pool in order)


def test_a_schedule_planned_after_its_first_trips_is_the_one_planned_from_the_beginning() -> None:
    search = begun(small_fleet(3, drones=3, requests=6))
    draws = np.random.default_rng(1)

    for _ in range(200):
        order = search.moves.changed(search.walked.order)
        found = search.scheduler.in_order(order, like=search.walked)
        again = search.scheduler.in_order(order)

        assert [(one.drone, one.trip) for one in found.trips] == [
            (one.drone, one.trip) for one in again.trips
        ]
        assert found.costs == again.costs
        if draws.random() < 0.5:
            search.walked = found


@pytest.mark.parametrize("seed", range(1, 13))
def test_a_small_fleet_costs_no_more_than_its_best_order(seed: int) -> None:
    found = compared(small_fleet(seed), rounds=60)

    assert found.worse <= 0.001
    assert found.unserved <= found.least_unserved
