"""The cached table of cells decides to which server each call goes."""

from collections.abc import AsyncIterator
from dataclasses import dataclass, field
from pathlib import Path

import httpx
import pytest

from skyway.announced_networks import check_stations
from skyway.cells import CellClients, Cells, ask_all
from skyway.contracts.cells import CELL_HEADER, CellTable, NetworkCell
from skyway.contracts.station_check import StationCheck, StationCheckQuery
from skyway.geo import Position
from skyway.ids import NetworkId, StationId
from skyway.json_model import WireModel
from skyway.runtime.errors import RemoteProblem, ServiceUnavailable
from skyway.runtime.http.client import ServiceClient
from skyway.runtime.http.identity import ServiceIdentity

NORTH, SOUTH = NetworkId("north"), NetworkId("south")
#: The stations of each server; `composition` is the server of all networks without a cell.
STATIONS = {"north": "n-s1", "composition": "s-s1"}


class Host(WireModel):
    host: str
    header: str | None


@dataclass
class Servers:
    """Servers of composition by their hosts, and the table that names them."""

    cells: list[NetworkCell] = field(default_factory=list)
    away: set[str] = field(default_factory=set)
    misdirected: set[str] = field(default_factory=set)
    empty: set[str] = field(default_factory=set)
    is_unreadable: bool = False
    cannot_keep: bool = False
    kept: list[CellTable] = field(default_factory=list)

    async def keep(self, table: CellTable) -> None:
        if self.cannot_keep:
            raise ServiceUnavailable("database", "away")
        self.kept.append(table)

    async def table(self) -> CellTable:
        if self.is_unreadable:
            raise ServiceUnavailable("registry", "away")
        return CellTable(cells=tuple(self.cells))

    def answer(self, request: httpx.Request) -> httpx.Response:
        host = request.url.host
        if host in self.away:
            raise httpx.ConnectError("away")
        if host in self.misdirected:
            return httpx.Response(421)
        if request.url.path == "/internal/station-checks":
            return self._checked(host, StationCheckQuery.read(request.content))
        said = Host(host=host, header=request.headers.get(CELL_HEADER))
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


def cell(
    network_id: NetworkId, host: str, *, generation: int = 1, is_open: bool = True
) -> NetworkCell:
    return NetworkCell(
        network_id=network_id,
        url=f"http://{host}",
        state="OPEN" if is_open else "CLOSED",
        generation=generation,
    )


@pytest.fixture
def around() -> Servers:
    return Servers()


@pytest.fixture
async def clients(around: Servers, tmp_path: Path) -> AsyncIterator[CellClients]:
    (tmp_path / "service_gateway").write_text("a secret of the gateway\n")
    default = ServiceClient(
        "composition",
        "http://composition",
        ServiceIdentity("gateway", tmp_path),
        transport=httpx.MockTransport(around.answer),
    )
    async with CellClients(default, Cells(around.table, keep=around.keep)) as opened:
        yield opened


async def who(client: ServiceClient) -> tuple[str, str | None]:
    """Which server answers, and what the request said in `CELL_HEADER`."""
    said = await client.call("GET", "/", answer=Host)
    return said.host, said.header


async def test_without_cells_everything_goes_to_the_default_server(clients: CellClients) -> None:
    await clients.refresh()

    assert await who(clients.of(NORTH)) == ("composition", None)
    assert await who(clients.of(None)) == ("composition", None)
    assert list(clients.every()) == ["composition"]


async def test_a_request_goes_to_the_cell_of_its_network_and_names_its_generation(
    clients: CellClients, around: Servers
) -> None:
    around.cells = [cell(NORTH, "north", generation=3)]
    await clients.refresh()

    assert await who(clients.of(NORTH)) == ("north", "north;3")
    assert await who(clients.of(SOUTH)) == ("composition", None)
    assert list(clients.every()) == ["composition", "the cell north"]


async def test_a_kept_table_is_used_until_the_table_can_be_read(
    clients: CellClients, around: Servers
) -> None:
    kept = CellTable(cells=(cell(NORTH, "north"),))
    around.is_unreadable = True
    await clients.begin_with(kept)
    first = await who(clients.of(NORTH))
    around.is_unreadable = False
    around.cells = [cell(NORTH, "elsewhere", generation=2)]
    await clients.refresh()

    assert first == ("north", "north;1")
    assert await who(clients.of(NORTH)) == ("elsewhere", "north;2")
    assert around.kept == [CellTable(cells=tuple(around.cells))]


async def test_a_table_that_could_not_be_kept_is_kept_later(
    clients: CellClients, around: Servers
) -> None:
    around.cells = [cell(NORTH, "north")]
    around.cannot_keep = True
    with pytest.raises(ServiceUnavailable):
        await clients.refresh()
    assert await who(clients.of(NORTH)) == ("north", "north;1")
    around.cannot_keep = False
    await clients.refresh()

    assert around.kept == [CellTable(cells=tuple(around.cells))]


async def test_networks_of_one_server_are_asked_once(clients: CellClients, around: Servers) -> None:
    around.cells = [cell(NORTH, "one"), cell(SOUTH, "one", generation=2)]
    await clients.refresh()

    assert list(clients.every()) == ["composition", "the cell north, south"]


async def test_a_closed_cell_gets_no_new_requests_and_still_answers_others(
    clients: CellClients, around: Servers
) -> None:
    around.cells = [cell(NORTH, "north", is_open=False)]
    await clients.refresh()

    with pytest.raises(ServiceUnavailable, match="the cell north is unavailable: it is closed"):
        clients.open_for(NORTH)
    assert await who(clients.of(NORTH)) == ("north", "north;1")


async def test_a_server_that_no_longer_serves_a_network_is_unavailable(
    clients: CellClients, around: Servers
) -> None:
    around.cells = [cell(NORTH, "north")]
    around.misdirected = {"north"}
    await clients.refresh()

    with pytest.raises(ServiceUnavailable, match="the cell north is unavailable: another server"):
        await who(clients.of(NORTH))


async def test_a_silent_cell_is_named_and_does_not_silence_the_others(
    clients: CellClients, around: Servers
) -> None:
    around.cells = [cell(NORTH, "north")]
    around.away = {"north"}
    await clients.refresh()

    answers = await ask_all(clients.every(), who)

    assert answers.given == {"composition": ("composition", None)}
    assert list(answers.silent) == ["the cell north"]
    with pytest.raises(ServiceUnavailable, match="the cell north"):
        answers.must_be_whole()


async def test_stations_of_two_servers_are_found_and_do_not_reach_each_other(
    clients: CellClients, around: Servers
) -> None:
    around.cells = [cell(NORTH, "north")]
    await clients.refresh()
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
    around.cells = [cell(NORTH, "north")]
    around.away = {"north"}
    await clients.refresh()

    found = await check_stations(clients, StationCheckQuery(station_ids=(StationId("s-s1"),)))

    assert found.unknown == ()
    with pytest.raises(ServiceUnavailable, match="the cell north"):
        await check_stations(clients, StationCheckQuery(station_ids=(StationId("n-s1"),)))


async def test_no_network_is_published_when_every_server_says_so(
    clients: CellClients, around: Servers
) -> None:
    around.cells = [cell(NORTH, "north")]
    await clients.refresh()
    query = StationCheckQuery(station_ids=(StationId("n-s1"),))

    around.empty = {"composition"}
    assert (await check_stations(clients, query)).unknown == ()
    around.empty = {"composition", "north"}
    with pytest.raises(RemoteProblem):
        await check_stations(clients, query)


async def test_a_table_that_stays_is_kept_once(around: Servers, clients: CellClients) -> None:
    around.cells = [cell(NORTH, "north")]

    for _ in range(3):
        await clients.refresh()

    assert len(around.kept) == 1


async def test_a_table_is_as_old_as_the_question_for_it(around: Servers) -> None:
    """Its answer may have taken seconds, and cells may have changed meanwhile."""
    now_s = 0.0

    async def slow_table() -> CellTable:
        nonlocal now_s
        now_s += 5.0
        return await around.table()

    cells = Cells(slow_table, now=lambda: now_s)
    before = cells.age_s
    await cells.refresh()

    assert (before, cells.age_s) == (None, 5.0)
