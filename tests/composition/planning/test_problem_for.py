"""Margins: every booked plan has them, a pure composition has none."""

from typing import Any

import pytest
from skyway_composition.planning.problem_for import with_margin

from skyway.delivery.plan import Plan
from skyway.drone.flight import flight_power_w
from skyway.drone.models import PAPER_SCENARIO

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)


def test_a_margin_is_a_share_of_the_energy_of_every_flight(migrated_url: str) -> None:
    careful = with_margin(PAPER_SCENARIO, 0.25)

    for load_kg in (0.0, 3.0):
        assert flight_power_w(careful, load_kg) == pytest.approx(
            1.25 * flight_power_w(PAPER_SCENARIO, load_kg)
        )
    assert careful.battery_j == PAPER_SCENARIO.battery_j


async def composed(composition: Any) -> Plan:
    problem = {
        "network": {"network_id": "row"},
        "drone": {"model": PAPER_SCENARIO.model_dump(mode="json"), "soc": 0.9},
        "source": "a",
        "packages": [{"package_id": "p1", "mass_kg": 0.4, "destination": "c"}],
    }
    answer = await composition("operator:op", "POST", "/v1/compositions", problem)
    assert answer.status_code == 200, answer.text
    return Plan.model_validate_json(answer.content)


async def test_a_pure_composition_has_no_margins(composition: Any, make: Any) -> None:
    await composition.publish(make.network(energy_margin=0.0, pad_gap_s=0))
    bare = await composed(composition)
    await composition.publish(make.network(energy_margin=0.5, pad_gap_s=3_600))

    plan = await composed(composition)

    assert plan.steps == bare.steps
