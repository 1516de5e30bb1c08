"""A home or a tariff with which a drone would never get a delivery is refused when it is set."""

from typing import Any

import pytest

from skyway.contracts.station_check import NetworkFacts
from skyway.ids import ConnectorId, NetworkId, StationId
from tests.provider_registry.conftest import KnownStations
from tests.provider_registry.fleets.test_drone_model_routes import MODEL

DRONE = {"model_id": "plugged", "home_station_id": "san-marcos"}
TEXAS = NetworkId("texas")
OTHERS_PADS = NetworkFacts(currency="USD", connectors=(ConnectorId("ccs"),))
EUROS = NetworkFacts(currency="EUR", connectors=None)
PLUGGED = {**MODEL, "model_id": "plugged", "connector": "type-2"}


def set_texas(stations: KnownStations, fault: str) -> None:
    if fault == "isolated":
        stations.isolated = (StationId("san-marcos"), StationId("mcqueeney"))
    else:
        stations.networks = {TEXAS: EUROS if fault == "currency" else OTHERS_PADS}


FAULTS = {
    "isolated": ("home_station_id", "no segment begins at"),
    "currency": ("home_station_id", "are in EUR, and the provider's tariff is in USD"),
    "connector": ("model_id", "its connector type-2 fits no pad of network texas, which has ccs"),
}


@pytest.fixture
async def provider_id(api: Any) -> str:
    await api("operator:op", "PUT", "/v1/drone-models/plugged", PLUGGED)
    return str(await api.provider())


@pytest.mark.parametrize("fault", FAULTS)
async def test_a_drone_that_could_never_work_is_not_registered(
    api: Any, provider_id: str, stations: KnownStations, fault: str
) -> None:
    set_texas(stations, fault)

    answer = await api(
        f"provider:{provider_id}", "POST", f"/v1/providers/{provider_id}/drones", DRONE
    )

    (error,) = answer.json()["errors"]
    field, detail = FAULTS[fault]
    assert (answer.status_code, error["field"]) == (422, field)
    assert detail in error["detail"]


@pytest.mark.parametrize("fault", FAULTS)
async def test_a_drone_is_not_moved_to_a_home_where_it_could_never_work(
    api: Any, provider_id: str, stations: KnownStations, fault: str
) -> None:
    drone = await api.drone(provider_id, model_id="plugged")
    set_texas(stations, fault)
    path = f"/v1/providers/{provider_id}/drones/{drone['drone_id']}"

    answer = await api(f"provider:{provider_id}", "PATCH", path, {"home_station_id": "mcqueeney"})

    (error,) = answer.json()["errors"]
    assert (answer.status_code, error["field"]) == (422, "home_station_id")
    assert FAULTS[fault][1] in error["detail"]


async def test_a_tariff_in_another_currency_than_the_networks_of_the_drones_is_refused(
    api: Any, provider_id: str, stations: KnownStations
) -> None:
    path, tariff = f"/v1/providers/{provider_id}", {"tariff": {"currency": "EUR", "base": 1}}
    stations.networks = {TEXAS: OTHERS_PADS}

    without_drones = await api(f"provider:{provider_id}", "PATCH", path, tariff)
    await api(f"provider:{provider_id}", "PATCH", path, {"tariff": {"currency": "USD"}})
    await api.drone(provider_id)
    with_drones = await api(f"provider:{provider_id}", "PATCH", path, tariff)

    assert without_drones.status_code == 200
    (error,) = with_drones.json()["errors"]
    assert (with_drones.status_code, error["field"]) == (422, "tariff.currency")
    assert "prices in network texas" in error["detail"]


async def test_a_drone_whose_connector_fits_is_registered(
    api: Any, provider_id: str, stations: KnownStations
) -> None:
    fitting = NetworkFacts(currency="USD", connectors=(ConnectorId("ccs"), ConnectorId("type-2")))
    stations.networks = {TEXAS: fitting}

    drone = await api.drone(provider_id, model_id="plugged")

    assert drone["model"]["connector"] == "type-2"
