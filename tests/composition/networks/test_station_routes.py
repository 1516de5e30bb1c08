"""Stations of networks over REST, and other services' questions about stations."""

from typing import Any

import pytest

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)

PATH = "/v1/networks/row"


async def test_a_drone_finds_the_stations_in_a_box(composition: Any) -> None:
    every = (await composition("drone:d", "GET", f"{PATH}/stations")).json()["items"]
    second = next(item for item in every if item["station_id"] == "b")
    longitude, latitude = second["position"]
    around = f"{longitude - 0.001},{latitude - 0.001},{longitude + 0.001},{latitude + 0.001}"
    over_the_date_line = f"{longitude + 0.001},-90,{longitude - 0.001},90"

    inside = await composition("drone:d", "GET", f"{PATH}/stations?bbox={around}")
    others = await composition("drone:d", "GET", f"{PATH}/stations?bbox={over_the_date_line}")

    assert inside.json()["items"] == [second]
    assert [item["station_id"] for item in others.json()["items"]] == ["a", "c", "d", "e"]


async def test_a_drone_sees_which_stations_are_closed(composition: Any) -> None:
    await composition("operator:op", "POST", "/v1/stations/b/closures")
    await composition("operator:op", "POST", "/v1/stations/c/pads/0/outages")

    every = (await composition("drone:d", "GET", f"{PATH}/stations")).json()["items"]

    assert [item["station_id"] for item in every if item["is_closed"]] == ["b"]


@pytest.mark.parametrize("bbox", ["", "1,2,3", "1,2,3,x", "0,1,0,0", "0,0,0,91", "nan,0,0,0"])
async def test_an_impossible_box_is_refused(composition: Any, bbox: str) -> None:
    answer = await composition("drone:d", "GET", f"{PATH}/stations?bbox={bbox}")

    assert (answer.status_code, answer.json()["errors"][0]["field"]) == (422, "bbox")


async def test_a_station_check_names_positions_and_unknown_and_unreachable_stations(
    composition: Any, make: Any
) -> None:
    await composition("operator:op", "PUT", "/v1/networks/other", make.network(stations="yz"))
    query = {"station_ids": ["c", "z", "nowhere"], "reachable_from": "a"}

    answer = await composition("service:gateway", "POST", "/internal/station-checks", query)

    assert answer.json() == {
        "network_ids": {"c": "row", "z": "other"},
        "positions": {"c": [2 * 0.17986, 0.0], "z": [25 * 0.17986, 0.0]},
        "unknown": ["nowhere"],
        "unreachable": ["z"],
        "closed": [],
        "isolated": [],
        "networks": {},
    }


async def test_a_station_check_names_the_stations_that_are_closed_now(composition: Any) -> None:
    await composition("operator:op", "POST", "/v1/stations/b/closures")
    query = {"station_ids": ["a", "b", "nowhere"]}

    answer = await composition("service:gateway", "POST", "/internal/station-checks", query)

    assert answer.json()["closed"] == ["b"]


async def test_a_check_of_homes_says_what_drones_meet_there(composition: Any, make: Any) -> None:
    alone = make.network(stations="yz")
    alone["features"] = [each for each in alone["features"] if each["geometry"]["type"] == "Point"]
    for feature in alone["features"]:
        feature["properties"] |= {"pads": 1, "pad_connectors": ["type-2"]}
    alone["settings"] = {"price_ceiling": 900}
    await composition("operator:op", "PUT", "/v1/networks/other", alone)
    query = {"station_ids": ["c", "z", "nowhere"], "as_homes": True}

    answer = await composition("service:registry", "POST", "/internal/station-checks", query)

    assert answer.json()["isolated"] == ["z"]
    assert answer.json()["networks"] == {
        "row": {"currency": "USD", "connectors": None, "price_ceiling": None},
        "other": {"currency": "USD", "connectors": ["type-2"], "price_ceiling": 900},
    }


async def test_a_station_check_of_an_empty_system_says_how_to_publish_a_network(
    unpublished: Any,
) -> None:
    answer = await unpublished(
        "service:gateway", "POST", "/internal/station-checks", {"station_ids": ["a"]}
    )

    assert (answer.status_code, answer.json()["code"]) == (409, "NO_NETWORK")
    assert answer.json()["detail"] == "no network is published: skyway network import bundled"


async def test_only_services_check_stations(composition: Any) -> None:
    answer = await composition(
        "customer:c", "POST", "/internal/station-checks", {"station_ids": ["a"]}
    )

    assert answer.status_code == 403


async def test_only_services_read_all_stations_of_a_network(composition: Any) -> None:
    path = "/internal/networks/row/stations"

    answer = await composition("service:gateway", "GET", path)
    refused = await composition("customer:c", "GET", path)

    stations = answer.json()
    assert (stations["network_id"], stations["version"]) == ("row", 1)
    assert stations["positions"][stations["station_ids"].index("c")] == [2 * 0.17986, 0.0]
    assert set(stations["parts"]) == {0}
    assert refused.status_code == 403
