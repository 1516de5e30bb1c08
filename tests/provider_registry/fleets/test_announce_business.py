"""Settings that get no deliveries since the network changed are reported to composition."""

import json
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from skyway_provider_registry.fleets import announce_business
from skyway_provider_registry.fleets.announce_business import BusinessAnnouncer

from skyway.cells import CellClients
from skyway.contracts.station_check import NetworkFacts
from skyway.ids import ConnectorId, NetworkId, StationId
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.http.client import ServiceClient
from skyway.runtime.http.identity import ServiceIdentity
from skyway.runtime.sql.database import Database
from tests.provider_registry.conftest import KnownStations
from tests.provider_registry.fleets.test_drone_model_routes import MODEL

TEXAS = NetworkId("texas")
PLUGGED = {**MODEL, "model_id": "plugged", "connector": "type-2"}


class Reports(dict[str, list[dict[str, Any]]]):
    """The faults of the last report to each server of composition."""

    def answer(self, request: httpx.Request) -> httpx.Response:
        assert request.url.path == "/internal/business-faults"
        self[request.url.host] = json.loads(request.content)["faults"]
        return httpx.Response(204)

    def codes(self, server: str = "composition") -> list[str]:
        return [each["code"] for each in self[server]]


@pytest.fixture
def reports() -> Reports:
    return Reports()


@pytest.fixture
async def all_servers(secrets_dir: Path, reports: Reports) -> AsyncIterator[CellClients]:
    identity, transport = ServiceIdentity("registry", secrets_dir), httpx.MockTransport
    default = ServiceClient(
        "composition", "http://composition", identity, transport=transport(reports.answer)
    )
    async with CellClients(default, {NetworkId("ohio"): "http://south"}) as opened:
        yield opened


@pytest.fixture
def announcer(db: Database, stations: KnownStations, all_servers: CellClients) -> BusinessAnnouncer:
    return BusinessAnnouncer(db, stations, all_servers)


@pytest.fixture
async def provider_id(api: Any) -> str:
    """A provider with a drone that has a connector."""
    await api("operator:op", "PUT", "/v1/drone-models/plugged", PLUGGED)
    provider_id = str(await api.provider())
    await api.drone(provider_id, model_id="plugged")
    return provider_id


CHANGES = {
    "OTHER_CURRENCY": ({"currency": "EUR", "connectors": None}, "set a tariff in the currency"),
    "OTHER_CONNECTOR": ({"currency": "USD", "connectors": ("ccs",)}, "another connector"),
    "ABOVE_PRICE_CEILING": (
        {"currency": "USD", "connectors": None, "price_ceiling": 299},
        "lower the tariff's base",
    ),
}


@pytest.mark.parametrize("code", CHANGES)
async def test_a_provider_is_told_what_to_change_when_its_network_has_changed(
    announcer: BusinessAnnouncer,
    stations: KnownStations,
    reports: Reports,
    provider_id: str,
    code: str,
) -> None:
    facts, change = CHANGES[code]
    await announcer.step()
    assert reports == {"composition": [], "south": []}

    stations.networks = {TEXAS: NetworkFacts.model_validate(facts)}
    await announcer.step()

    (fault,) = reports["composition"]
    assert (fault["provider_id"], fault["network_id"]) == (provider_id, "texas")
    assert fault["code"] == code
    assert change in fault["detail"]


async def test_a_price_at_the_ceiling_is_no_fault(
    announcer: BusinessAnnouncer, stations: KnownStations, reports: Reports, provider_id: str
) -> None:
    facts = NetworkFacts(currency="USD", connectors=None, price_ceiling=300)
    stations.networks = {TEXAS: facts}

    await announcer.step()

    assert reports.codes() == []


async def test_homes_from_which_no_segment_begins_any_more_are_one_fault_of_the_network(
    api: Any,
    announcer: BusinessAnnouncer,
    stations: KnownStations,
    reports: Reports,
    provider_id: str,
) -> None:
    await api.drone(provider_id, home_station_id="mcqueeney")
    stations.isolated = (StationId("san-marcos"), StationId("mcqueeney"))

    await announcer.step()

    assert reports.codes() == ["HOME_ISOLATED"]


async def test_each_server_gets_the_faults_in_its_own_networks(
    api: Any,
    announcer: BusinessAnnouncer,
    stations: KnownStations,
    reports: Reports,
    provider_id: str,
) -> None:
    stations.elsewhere = {"mcqueeney": "ohio"}
    await api.drone(provider_id, home_station_id="mcqueeney")
    others = (ConnectorId("ccs"),)
    stations.networks = {
        NetworkId("ohio"): NetworkFacts(currency="EUR", connectors=None),
        TEXAS: NetworkFacts(currency="USD", connectors=others),
    }

    await announcer.step()

    assert reports.codes() == ["OTHER_CONNECTOR"]
    assert reports.codes("south") == ["OTHER_CURRENCY"]


async def test_a_suspended_provider_is_not_told_of_its_settings(
    api: Any,
    announcer: BusinessAnnouncer,
    stations: KnownStations,
    reports: Reports,
    provider_id: str,
) -> None:
    stations.networks = {TEXAS: NetworkFacts(currency="EUR", connectors=None)}
    path = f"/v1/providers/{provider_id}"
    await api("operator:op", "PATCH", path, {"state": "SUSPENDED"})

    await announcer.step()

    assert reports.codes() == []


async def test_faults_above_the_limit_are_left_out(
    api: Any,
    announcer: BusinessAnnouncer,
    stations: KnownStations,
    reports: Reports,
    provider_id: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(announce_business, "MOST_FAULTS", 1)
    await api.drone(str(await api.provider()))
    stations.networks = {TEXAS: NetworkFacts(currency="EUR", connectors=None)}

    await announcer.step()

    assert len(reports["composition"]) == 1


async def test_nothing_is_reported_while_the_stations_are_not_known(
    announcer: BusinessAnnouncer, stations: KnownStations, reports: Reports, provider_id: str
) -> None:
    stations.is_away = True

    with pytest.raises(ServiceUnavailable):
        await announcer.step()

    assert reports == {}
