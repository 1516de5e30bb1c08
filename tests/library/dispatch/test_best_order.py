"""The best order of small fleets, beside the schedules of all their orders."""

from collections.abc import Sequence
from itertools import product

import pytest
from skyway_lab.benchmarks.dispatch.small import all_schedules, small_fleet

from skyway.dispatch.best_order import BestOrder
from skyway.dispatch.optimise import begun, optimise, proven_s
from skyway.dispatch.problem import FleetProblem
from skyway.drone.charging import soc_after_recharge
from tests.library.dispatch.fleets import MODEL, with_pickups, without_promises
from tests.library.dispatch.fleets import small_fleet as city_fleet
from tests.long_cases import sampled


def proven_and_best_s(problem: FleetProblem) -> tuple[float, float]:
    """What branch and bound finds from the first schedule on, and the best of all orders."""
    search = begun(problem)
    tree = BestOrder(search.scheduler, search.limits)
    found = search.best
    while not tree.is_done:
        found = tree.step(found)
    best_s = min((each.costs.total_s for each in all_schedules(search)), default=0.0)
    return found.costs.total_s, best_s


@pytest.mark.parametrize("seed", range(60, 80))
def test_the_lower_bound_of_a_fleet_with_few_pads_is_below_every_order(seed: int) -> None:
    search = begun(small_fleet(seed, requests=3))
    best_s = min(each.costs.total_s for each in all_schedules(search))

    search.run(lambda rounds: rounds >= 3)

    assert 0 < proven_s(search) <= best_s + 0.1


def charged_first(problem: FleetProblem, pauses_s: Sequence[float]) -> FleetProblem:
    """The problem after each drone has charged for so long where it stands, if it can."""
    drones = []
    for drone, pause_s in zip(problem.drones, pauses_s, strict=True):
        has_pad = problem.network.stations[drone.station_id].pads > 0
        soc = soc_after_recharge(drone.model, drone.soc, pause_s) if has_pad else drone.soc
        free_s = drone.free_s + pause_s
        drones.append(drone.model_copy(update={"soc": soc, "free_s": free_s}))
    return problem.model_copy(update={"drones": tuple(drones)})


@pytest.mark.parametrize("seed", sampled(range(30), every=4))
def test_the_lower_bound_holds_if_drones_charge_longer_than_their_trips_need(seed: int) -> None:
    problem = small_fleet(seed, requests=3)
    bound_s = proven_s(begun(problem))

    for pauses_s in product((0.0, 900.0), repeat=2):
        search = begun(charged_first(problem, pauses_s))
        search.run(lambda rounds: rounds >= 3)
        assert bound_s <= search.best.costs.total_s + 0.1


@pytest.mark.parametrize("seed", sampled(range(20, 32), every=3))
@pytest.mark.parametrize("energy_s_per_kwh", [0.0, 20_000.0])
def test_no_order_of_a_fleet_with_few_pads_costs_less(seed: int, energy_s_per_kwh: float) -> None:
    problem = small_fleet(seed, requests=3)
    prices = problem.prices.model_copy(update={"energy_s_per_kwh": energy_s_per_kwh})

    proven_s, best_s = proven_and_best_s(problem.model_copy(update={"prices": prices}))

    assert proven_s == pytest.approx(best_s, abs=0.01)


@pytest.mark.parametrize("seed", sampled(range(40, 48), every=3))
def test_no_order_costs_less_if_landings_cost_and_loads_are_slow(seed: int) -> None:
    problem = small_fleet(seed, requests=3)
    slow = {"speed_full_mps": 10.0, "stop_s": 40.0, "stop_j": 15_000.0}
    first, *others = problem.drones
    drones = (first.model_copy(update={"model": first.model.model_copy(update=slow)}), *others)
    requests = tuple(
        each.model_copy(update={"weight": 1.0 + number})
        for number, each in enumerate(problem.requests)
    )
    changed = problem.model_copy(update={"drones": drones, "requests": requests})

    found_s, best_s = proven_and_best_s(changed)

    assert found_s == pytest.approx(best_s, abs=0.01)
    assert proven_s(begun(changed)) <= best_s + 0.1


@pytest.mark.parametrize("seed", sampled(range(12), every=3))
@pytest.mark.parametrize("has_promises", [False, True])
def test_no_order_of_a_city_fleet_costs_less(seed: int, has_promises: bool) -> None:
    problem = with_pickups(city_fleet(seed, drones=2, requests=3), seed)

    proven_s, best_s = proven_and_best_s(problem if has_promises else without_promises(problem))

    assert proven_s == pytest.approx(best_s, abs=0.01)


@pytest.mark.long
@pytest.mark.parametrize(("drones", "requests", "seed"), [(2, 4, 50), (2, 4, 51), (3, 5, 52)])
def test_no_order_of_a_larger_fleet_costs_less(drones: int, requests: int, seed: int) -> None:
    proven_s, best_s = proven_and_best_s(small_fleet(seed, drones=drones, requests=requests))

    assert proven_s == pytest.approx(best_s, abs=0.01)


def test_the_plan_of_a_small_fleet_says_that_no_order_costs_less() -> None:
    plan = optimise(small_fleet(1), rounds=20)

    assert plan.is_best_order
    assert plan.rounds < 20


def test_a_larger_fleet_is_proven_after_few_nodes() -> None:
    search = begun(small_fleet(16, drones=4, requests=8))

    search.run(lambda rounds: rounds >= 2)

    assert search.is_proven
    assert proven_s(search) > 0.9 * search.best.costs.total_s


def test_a_proof_in_one_of_several_searches_counts() -> None:
    assert optimise(small_fleet(1), rounds=20, searches=2).is_best_order


def test_no_order_is_proven_if_the_search_ends_early_or_the_fleet_is_large() -> None:
    assert not optimise(small_fleet(1, drones=4, requests=8), rounds=1).is_best_order
    assert not optimise(small_fleet(1, drones=5, requests=3), rounds=20).is_best_order


def test_no_order_is_proven_if_a_load_makes_a_drone_faster() -> None:
    problem = city_fleet(1, drones=2, requests=3)
    model = MODEL.model_copy(update={"speed_empty_mps": 8.0, "speed_full_mps": 20.0})
    drones = tuple(each.model_copy(update={"model": model}) for each in problem.drones)

    plan = optimise(problem.model_copy(update={"drones": drones}), rounds=5)

    assert not plan.is_best_order


def test_no_order_is_proven_if_the_labels_of_a_trip_are_used_up() -> None:
    problem = small_fleet(1).model_copy(update={"label_limit": 10})

    assert not optimise(problem, rounds=5).is_best_order
