"""Moves that the exact planner judges: what they keep, and what they find."""

import numpy as np
import pytest
from skyway_lab.benchmarks.dispatch.small import compared, small_fleet

from skyway.dispatch.optimise import begun, searched
from skyway.dispatch.order_moves import Order, OrderMoves
from tests.library.dispatch.fleets import small_fleet as city_fleet
from tests.library.dispatch.fleets import without_promises
from tests.long_cases import sampled


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


@pytest.mark.parametrize("seed", sampled(range(1, 13), every=3))
def test_a_small_fleet_costs_no_more_than_its_best_order(seed: int) -> None:
    found = compared(small_fleet(seed), rounds=60)

    assert found.worse <= 0.001
    assert found.unserved <= found.least_unserved


def test_leads_change_only_in_which_order_the_drones_are_planned() -> None:
    search = begun(small_fleet(3, drones=3, requests=6))
    rule = search.scheduler.planned(search.best.sequences(3))
    leads_ms = np.zeros(6, np.int64)

    for _ in range(100):
        leads_ms = search.moves.other_leads(leads_ms)
        sequences = rule.sequences(3)
        found = search.scheduler.planned(sequences, leads_ms=leads_ms, like=rule)
        again = search.scheduler.planned(sequences, leads_ms=leads_ms)

        assert found.order == again.order
        assert found.costs == again.costs
        assert found.sequences(3) == sequences


def test_a_request_with_a_long_lead_is_planned_first() -> None:
    search = begun(small_fleet(3, drones=3, requests=6))
    rule = search.scheduler.planned(search.best.sequences(3))
    last_of_first_trips = max(row[0] for row in rule.sequences(3) if row)
    leads_ms = np.zeros(6, np.int64)
    leads_ms[last_of_first_trips[0]] = 10**9

    found = search.scheduler.planned(rule.sequences(3), leads_ms=leads_ms)

    assert found.order[0][1] == last_of_first_trips


def test_a_larger_fleet_is_planned_in_a_better_order_than_by_the_rule() -> None:
    problem = without_promises(city_fleet(1, drones=4, requests=24))
    requests = tuple(each.model_copy(update={"pooling": False}) for each in problem.requests)
    alone = problem.model_copy(update={"requests": requests})

    search = searched(alone, rounds=24, most_steps=2_000, seed=1)
    by_rule = search.scheduler.planned(search.best.sequences(4))

    assert search.leads_ms.any()
    assert search.best.costs.total_s < by_rule.costs.total_s
