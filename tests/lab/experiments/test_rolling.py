"""A simulated hour whose requests are planned together each minute."""

from dataclasses import replace

import pytest
from skyway_lab.experiments.dispatched_hour.cases import fleet_case
from skyway_lab.experiments.dispatched_hour.policies import searched_in_rounds, searches
from skyway_lab.experiments.dispatched_hour.rolling import RollingHour
from skyway_lab.experiments.fleet_hour.cases import Load


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
