"""A simulated hour whose requests are planned together each minute."""

from dataclasses import replace

import pytest
from skyway_lab.experiments.dispatched_hour.cases import fleet_case
from skyway_lab.experiments.dispatched_hour.policies import searched_in_rounds, searches
from skyway_lab.experiments.dispatched_hour.rolling import RollingHour
from skyway_lab.experiments.fleet_hour.cases import Load

from skyway.dispatch.problem import FleetProblem
from skyway.dispatch.schedule import Schedule


@pytest.mark.long
@pytest.mark.parametrize("tolerance_s", [0.0, 600.0])
def test_no_delivery_is_later_than_its_promise_allows(tolerance_s: float) -> None:
    search, *_ = searches(searched_in_rounds(2, most_steps=2_000))
    policy = replace(search, promise_tolerance_s=tolerance_s)
    hour = RollingHour(fleet_case("city", Load(2, 8), seed=1), policy, 1)

    hour.run()

    assert hour.served_share == 1.0
    late_s = [(hour.delivered_ms[n] - at_ms) / 1000 for n, at_ms in hour.promised_ms.items()]
    assert max(late_s) <= tolerance_s
    assert min(late_s) < 0


def test_a_far_delivery_has_a_wider_promise_than_a_near_one() -> None:
    search, *_ = searches(searched_in_rounds(2, most_steps=2_000))
    policy = replace(search, promise_tolerance_s=60.0, wider_by=0.5)
    hour = RollingHour(fleet_case("city", Load(2, 8), seed=1), policy, 1)
    asked_ms = {each.number: each.asked_ms for each in hour.case.hour.requests}

    before_s = hour.width_s(0)
    hour.promised_ms |= {0: asked_ms[0] + 5_100_000, 1: asked_ms[1] + 5_300_000}

    assert (before_s, hour.width_s(0), hour.width_s(1)) == (None, 60.0, 160.0)


def test_a_delivery_with_a_window_comes_in_it_and_is_promised_until_its_end() -> None:
    search, *_ = searches(searched_in_rounds(2, most_steps=2_000))
    policy = replace(search, promise_tolerance_s=60.0, window_s=1_800.0)
    case = fleet_case("city", Load(2, 3), seed=1)
    first, *others = case.hour.requests
    packages = tuple(each.model_copy(update={"not_before_s": 9_000.0}) for each in first.packages)
    requests = (replace(first, packages=packages), *others)
    hour = RollingHour(replace(case, hour=replace(case.hour, requests=requests)), policy, 1)

    hour.run()

    promised_s, width_s = hour.promised_ms[0] / 1000, hour.width_s(0)
    assert width_s is not None
    assert promised_s + width_s == pytest.approx(10_800.0)
    assert 9_000.0 <= hour.delivered_ms[0] / 1000 <= 10_800.0
    assert max(hour.delivered_ms[each.number] for each in others) < 9_000_000


@pytest.mark.long
def test_requests_are_planned_when_their_batch_ends() -> None:
    search, *_ = searches(searched_in_rounds(2, most_steps=2_000))
    case = fleet_case("city", Load(2, 8), seed=1)
    seen: list[float] = []

    def noted(problem: FleetProblem, seed: int) -> Schedule:
        seen.extend(-each.known_s for each in problem.requests if each.planned is None)
        return search.plan(problem, seed)

    RollingHour(case, replace(search, plan=noted, batch_s=5.0), 1).run()

    assert 0.0 < max(seen) < 5.0


@pytest.mark.long
def test_a_drone_flies_to_the_pickup_while_its_trip_waits_for_more_requests() -> None:
    *_, waits = searches(searched_in_rounds(2, most_steps=2_000))
    assert waits.ahead_s is not None
    case = fleet_case("three hubs", Load(4, 12), seed=1)
    ahead, stays = (
        RollingHour(case, policy, 1) for policy in (waits, replace(waits, ahead_s=None))
    )

    ahead.run()
    stays.run()

    assert ahead.flights_ahead > stays.flights_ahead == 0
    assert ahead.served_share == stays.served_share == 1.0
    assert ahead.mean_min < stays.mean_min
