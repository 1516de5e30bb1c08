"""The measures of an hour under a policy."""

import pytest
from skyway_lab.experiments.fleet_hour.calendars import CHAINED, ONE_AT_A_TIME, POLICIES, Policy
from skyway_lab.experiments.fleet_hour.cases import Load
from skyway_lab.experiments.fleet_hour.measures import HourTrial, measure

LOAD = Load(drones=2, requests=6)


@pytest.mark.parametrize("policy", POLICIES, ids=lambda policy: policy.name)
def test_the_shares_of_the_drones_time_add_up(policy: Policy) -> None:
    measures = measure(HourTrial("city", LOAD, policy, seed=1))

    assert all(share >= 0 for share in measures.shares.values())
    assert 0 <= measures.idle_share <= 1
    assert len(measures.delays_min) == LOAD.requests


def test_a_chained_fleet_is_held_shorter_and_uses_less_energy() -> None:
    before, chained = (
        measure(HourTrial("city", LOAD, policy, seed=1)) for policy in (ONE_AT_A_TIME, CHAINED)
    )

    assert before.served_share < chained.served_share == 1
    assert chained.held_h < before.held_h
    assert chained.energy_kwh < before.energy_kwh
    assert before.shares["standby"] > chained.shares["standby"]
