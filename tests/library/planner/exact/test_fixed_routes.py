"""Recharging along a fixed route, beside frvcpy's exact algorithm on its own instance."""

import json
from pathlib import Path
from typing import Any

import pytest

from skyway.planner.airspace import Airspace
from skyway.planner.exact import exact_with
from skyway.planner.exact_task import Method
from skyway.planner.situation import Situation
from skyway.planner.stop import Effort, never
from tests.library.planner.oracles.fixed_routes import as_problem, delivery_time_s, order_of

_INSTANCE: dict[str, Any] = json.loads((Path(__file__).parent / "fixed_routes.json").read_text())


@pytest.mark.parametrize("result", _INSTANCE["results"])
def test_inserted_charging_stops_take_as_long_as_those_of_frvcpy(result: dict[str, Any]) -> None:
    problem = as_problem(_INSTANCE, result["charger"], result["route"])
    situation = Situation.of(problem, Airspace.of(problem.network))
    strategy = exact_with(Method(), order=order_of(result["route"]))

    itinerary = strategy(situation, Effort(never)).itinerary

    assert itinerary is not None
    assert itinerary.delivered_s == pytest.approx(delivery_time_s(_INSTANCE, result), abs=1e-3)
