"""How far the charge takes a drone in this wind, and how sure that is."""

from typing import Any

import pytest
from skyway_drone_agent.analysis.landings import Landing
from skyway_drone_agent.analysis.reach import Reach

from skyway.geo import Position, distance_m
from skyway.ids import StationId

HERE = Position(-98.0, 30.0)
EAST = Landing(StationId("east"), Position(-97.9, 30.0))
WEST = Landing(StationId("west"), Position(-98.1, 30.0))

#: 20 m/s and 100 W without load.
LENGTH_M = distance_m(HERE, EAST.position)


def make_reach(drone: Any, **changes: Any) -> Reach:
    fields = {
        "model": drone.model,
        "soc": 0.5,
        "soc_error": 0.01,
        "state_of_health": 1.0,
        "still_air_factor": 1.0,
        "wind_mps": (0.0, 0.0),
    }
    return Reach(**fields | changes)


def used(drone: Any, reach: Reach) -> dict[str, float]:
    """Joules that the flights to both landings take."""
    found = reach.landings_in_reach((EAST, WEST), position=HERE, load_kg=0.0)
    return {one.station_id: (reach.soc - one.soc_at_landing) * 360_000 for one in found}


def test_a_landing_against_the_wind_takes_more_than_one_before_it(drone: Any) -> None:
    taken_j = used(drone, make_reach(drone, wind_mps=(5.0, 0.0)))

    assert taken_j["east"] == pytest.approx(LENGTH_M / 25.0 * 100.0 + 1_000.0, rel=1e-4)
    assert taken_j["west"] == pytest.approx(LENGTH_M / 15.0 * 100.0 + 1_000.0, rel=1e-4)


def test_high_energy_use_and_a_worn_battery_use_more_charge(drone: Any) -> None:
    taken_j = used(drone, make_reach(drone, still_air_factor=1.2, state_of_health=0.8))

    assert taken_j["east"] == pytest.approx((LENGTH_M * 5.0 * 1.2 + 1_000.0) / 0.8, rel=1e-4)


def test_a_safe_landing_keeps_a_margin_for_the_error_of_the_charge(drone: Any) -> None:
    soc = (LENGTH_M * 5.0 + 1_000.0) / 360_000 + 0.05

    sure, unsure = (
        make_reach(drone, soc=soc, soc_error=error).landings_in_reach(
            (EAST,), position=HERE, load_kg=0.0
        )
        for error in (0.005, 0.03)
    )

    assert [one.is_safe for one in sure] == [True]
    assert [one.is_safe for one in unsure] == [False]


def test_a_landing_beyond_the_charge_is_out_of_reach(drone: Any) -> None:
    assert used(drone, make_reach(drone, soc=0.1)) == {}


def test_the_range_holds_against_the_wind_above_the_reserve(drone: Any) -> None:
    calm = make_reach(drone).range_m(0.0)
    windy = make_reach(drone, wind_mps=(3.0, 4.0)).range_m(0.0)

    assert calm == pytest.approx((0.4 * 360_000 - 1_000) / 5.0)
    assert windy == pytest.approx(calm * 15.0 / 20.0)
