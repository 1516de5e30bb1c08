"""The power of pads: shares of a station, steps of a network; faults by their field."""

import json
import math
from typing import Any

import pytest

from skyway.errors import InvalidNetwork
from skyway.ids import StationId
from skyway.network.geojson import read_network, write_network
from skyway.network.geojson_text import network_text, read_network_text
from skyway.network.nx import from_networkx, to_networkx
from skyway.network.pad_power import MAX_POWERS


def document(*stations: dict[str, Any]) -> dict[str, Any]:
    """A network of stations s0, s1, ... with these properties."""
    return {
        "type": "FeatureCollection",
        "features": [
            {
                "type": "Feature",
                "geometry": {"type": "Point", "coordinates": [0.1 * number, 0.0]},
                "properties": {"kind": "station", "station_id": f"s{number}", **properties},
            }
            for number, properties in enumerate(stations)
        ],
    }


def test_plans_count_on_the_smaller_of_the_pads_power_and_its_share_of_the_station() -> None:
    powers = read_network(
        document(
            {"pads": 3},
            {"pads": 3, "pad_power_w": 400},
            {"pads": 4, "station_power_w": 1000},
            {"pads": 2, "pad_power_w": 400, "station_power_w": 1000},
            {"pads": 4, "pad_power_w": 400, "station_power_w": 1000.0},
        )
    ).pad_powers

    assert powers.limited_w == {"s1": 400, "s2": 250, "s3": 400, "s4": 250}
    assert powers.steps_w == (math.inf, 400, 250)
    assert powers.step.tolist() == [0, 1, 2, 1, 2]


def test_a_network_without_powers_has_one_step_without_a_limit() -> None:
    powers = read_network(document({}, {"pads": 0})).pad_powers

    assert (powers.limited_w, powers.steps_w, len(powers.step)) == ({}, (math.inf,), 0)


def test_stations_without_pads_add_no_step() -> None:
    powers = read_network(document({"pads": 0}, {"pad_power_w": 400})).pad_powers

    assert powers.steps_w == (400,)
    assert powers.step.tolist() == [0, 0]


def test_powers_survive_each_form_of_a_network() -> None:
    network = read_network(document({"pad_power_w": 400}, {"station_power_w": 1000, "pads": 3}))

    for copy in (
        read_network(write_network(network)),
        read_network_text(network_text(network)),
        from_networkx(to_networkx(network)),
    ):
        assert copy == network
        assert copy.pad_powers.limited_w == {StationId("s0"): 400, StationId("s1"): 1000 / 3}


@pytest.mark.parametrize(
    ("properties", "fault"),
    [
        ({"pad_power_w": 0}, "pad_power_w: 0 is below 10"),
        ({"pad_power_w": -5.0}, "pad_power_w: -5.0 is below 10"),
        ({"pad_power_w": 1e12}, "pad_power_w: 1000000000000.0 is above 1e+09"),
        ({"pad_power_w": "400"}, "pad_power_w: '400' is not a number"),
        ({"pad_power_w": None}, "pad_power_w: null is not a number"),
        ({"station_power_w": True}, "station_power_w: true is not a number"),
        ({"station_power_w": math.nan}, "station_power_w: nan is not a finite number"),
        ({"station_power_w": 30, "pads": 4}, "station_power_w: 7.5 W for each of 4 pads"),
        ({"pad_power_w": 400, "pads": 0}, "pad_power_w: the station has no pads"),
    ],
)
def test_a_wrong_power_is_named_by_both_readers(properties: dict[str, Any], fault: str) -> None:
    wrong = document({}, properties)

    with pytest.raises(InvalidNetwork) as of_document:
        read_network(wrong)
    with pytest.raises(InvalidNetwork) as of_text:
        read_network_text(json.dumps(wrong))

    assert str(of_document.value).startswith(f"features.1.properties.{fault}")
    assert str(of_text.value) == str(of_document.value)


def test_more_different_powers_than_the_planner_keeps_are_refused() -> None:
    different = [{"pad_power_w": 100 + number} for number in range(MAX_POWERS + 1)]

    assert len(read_network(document(*different[1:])).pad_powers.steps_w) == MAX_POWERS
    with pytest.raises(InvalidNetwork, match="33 different powers, at most 32"):
        read_network(document(*different))
