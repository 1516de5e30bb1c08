"""The setting of cells decides to which server each call goes."""

import re
from collections.abc import AsyncIterator, Callable, Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import httpx
import pytest

from skyway.announced_networks import check_stations
from skyway.cells import NETWORK_HEADER, CellClients, CellSettings, ask_all
from skyway.contracts.station_check import StationCheck, StationCheckQuery
from skyway.geo import Position
from skyway.ids import NetworkId, StationId
from skyway.json_model import WireModel
from skyway.runtime.errors import InvalidSettings, RemoteProblem, ServiceUnavailable
from skyway.runtime.http.client import ServiceClient
from skyway.runtime.http.identity import ServiceIdentity

NORTH, SOUTH = NetworkId("north"), NetworkId("south")
#: The stations of each server; `composition` is the server of all networks without a cell.
STATIONS = {"north": "n-s1", "composition": "s-s1"}

Clients = Callable[..., CellClients]


class Host(WireModel):
    host: str
    header: str | None


@dataclass
class Servers:
    """Servers of composition by their hosts."""

    away: set[str] = field(default_factory=set)
    misdirected: set[str] = field(default_factory=set)
    empty: set[str] = field(default_factory=set)

    def answer(self, request: httpx.Request) -> httpx.Response:
        host = request.url.host
        if host in self.away:
            raise httpx.ConnectError("away")
        if host in self.misdirected:
            return httpx.Response(421)
        if request.url.path == "/internal/station-checks":
            return self._checked(host, StationCheckQuery.read(request.content))
        said = Host(host=host, header=request.headers.get(NETWORK_HEADER))
        return httpx.Response(200, content=said.model_dump_json())

    def _checked(self, host: str, query: StationCheckQuery) -> httpx.Response:
        if host in self.empty:
            return httpx.Response(409, json={"title": "", "status": 409, "code": "NO_NETWORK"})
        own = StationId(STATIONS[host])
        known = [each for each in query.station_ids if each == own]
        check = StationCheck(
            network_ids=dict.fromkeys(known, NetworkId(host)),
            positions=dict.fromkeys(known, Position(0.0, 0.0)),
            unknown=tuple(each for each in query.station_ids if each != own),
            unreachable=tuple(known) if query.reachable_from not in (None, own) else (),
        )
        return httpx.Response(200, content=check.model_dump_json())


@pytest.fixture
def around() -> Servers:
    return Servers()


@pytest.fixture
def clients_for(around: Servers, tmp_path: Path) -> Clients:
    """Makes the clients of the default server and of these cells, given by their hosts."""
    (tmp_path / "service_gateway").write_text("a secret of the gateway\n")
    default = ServiceClient(
        "composition",
        "http://composition",
        ServiceIdentity("gateway", tmp_path),
        transport=httpx.MockTransport(around.answer),
    )

    def make(*, closed: Collection[NetworkId] = (), **hosts: str) -> CellClients:
        cells = {NetworkId(name): f"http://{host}" for name, host in hosts.items()}
        return CellClients(default, cells, closed)

    return make


@pytest.fixture
async def clients(clients_for: Clients) -> AsyncIterator[CellClients]:
    """The clients with a cell for the network north."""
    async with clients_for(north="north") as opened:
        yield opened


async def who(client: ServiceClient) -> tuple[str, str | None]:
    """Which server answers, and what the request said in `NETWORK_HEADER`."""
    said = await client.call("GET", "/", answer=Host)
    return said.host, said.header


async def test_without_cells_everything_goes_to_the_default_server(clients_for: Clients) -> None:
    async with clients_for() as clients:
        assert await who(clients.of(NORTH)) == ("composition", None)
        assert await who(clients.of(None)) == ("composition", None)
        assert list(clients.every()) == ["composition"]


async def test_a_request_goes_to_the_cell_of_its_network_and_names_the_network(
    clients: CellClients,
) -> None:
    assert await who(clients.of(NORTH)) == ("north", "north")
    assert await who(clients.of(SOUTH)) == ("composition", "south")
    assert list(clients.every()) == ["composition", "the cell north"]


async def test_networks_of_one_server_are_asked_once(clients_for: Clients) -> None:
    async with clients_for(north="one", south="one", west="composition") as clients:
        assert list(clients.every()) == ["composition", "the cell north, south"]


async def test_a_closed_network_gets_no_new_requests_and_still_answers_others(
    clients_for: Clients,
) -> None:
    async with clients_for(north="north", closed={NORTH}) as clients:
        with pytest.raises(ServiceUnavailable, match="the network north is unavailable: it is cl"):
            clients.open_for(NORTH)
        assert await who(clients.of(NORTH)) == ("north", "north")
        assert await who(clients.open_for(SOUTH)) == ("composition", "south")


async def test_a_server_that_no_longer_serves_a_network_is_unavailable(
    clients: CellClients, around: Servers
) -> None:
    around.misdirected = {"north"}

    with pytest.raises(ServiceUnavailable, match="the cell north is unavailable: another server"):
        await who(clients.of(NORTH))


async def test_a_silent_cell_is_named_and_does_not_silence_the_others(
    clients: CellClients, around: Servers
) -> None:
    around.away = {"north"}

    answers = await ask_all(clients.every(), who)

    assert answers.given == {"composition": ("composition", None)}
    assert list(answers.silent) == ["the cell north"]
    with pytest.raises(ServiceUnavailable, match="the cell north"):
        answers.must_be_whole()


async def test_stations_of_two_servers_are_found_and_do_not_reach_each_other(
    clients: CellClients, around: Servers
) -> None:
    ids = tuple(map(StationId, ("n-s1", "s-s1", "nowhere")))

    found = await check_stations(
        clients, StationCheckQuery(station_ids=ids, reachable_from=StationId("n-s1"))
    )

    assert found.network_ids == {"n-s1": "north", "s-s1": "composition"}
    assert found.unknown == ("nowhere",)
    assert found.unreachable == ("s-s1",)


async def test_a_lookup_fails_if_only_a_silent_server_may_know_the_station(
    clients: CellClients, around: Servers
) -> None:
    around.away = {"north"}

    found = await check_stations(clients, StationCheckQuery(station_ids=(StationId("s-s1"),)))

    assert found.unknown == ()
    with pytest.raises(ServiceUnavailable, match="the cell north"):
        await check_stations(clients, StationCheckQuery(station_ids=(StationId("n-s1"),)))


async def test_no_network_is_published_when_every_server_says_so(
    clients: CellClients, around: Servers
) -> None:
    query = StationCheckQuery(station_ids=(StationId("n-s1"),))

    around.empty = {"composition"}
    assert (await check_stations(clients, query)).unknown == ()
    around.empty = {"composition", "north"}
    with pytest.raises(RemoteProblem):
        await check_stations(clients, query)


def cells_of_environment(monkeypatch: pytest.MonkeyPatch, text: str) -> Mapping[NetworkId, str]:
    """The cells of a service with this variable."""
    given = {"DATABASE_URL": "sqlite:///a.db", "MQTT_URL": "mqtt://a", "SECRETS_DIR": "/s"}
    for name, value in (given | {"CELLS": text}).items():
        monkeypatch.setenv(f"SKYWAY_{name}", value)
    return CellSettings.load().cells


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("texas", "texas must look like texas=http://composition-texas:8002"),
        ("texas=composition:8002", "texas=composition:8002 must look like"),
        ("texas=http://a:8002/", "texas=http://a:8002/ must look like"),
        ("two words=http://a:8002", "two words=http://a:8002 must look like"),
        ("texas=http://user:word@a:8002", "must look like"),
        ("texas=http://a, ohio=http://b,texas=http://b", "two addresses: http://a and http://b"),
    ],
)
def test_a_wrong_or_contradictory_cell_is_named(
    monkeypatch: pytest.MonkeyPatch, text: str, fault: str
) -> None:
    with pytest.raises(InvalidSettings, match=f"SKYWAY_CELLS: .*{re.escape(fault)}"):
        cells_of_environment(monkeypatch, text)


def test_cells_are_networks_with_addresses(monkeypatch: pytest.MonkeyPatch) -> None:
    cells = cells_of_environment(monkeypatch, "texas=http://a:8002/c , ohio=https://b,")

    assert cells == {"texas": "http://a:8002/c", "ohio": "https://b"}
