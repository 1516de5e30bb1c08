"""The table of cells: what operators may change, and what each refusal says to do."""

from typing import Any

import pytest
from skyway_provider_registry.tables import cells
from skyway_provider_registry.verify import RULES

from skyway.cells import CellClients
from skyway.contracts.cells import CellWork
from skyway.ids import NetworkId
from skyway.runtime.sql.database import Database
from tests.broken_rules import broken_rules
from tests.provider_registry.conftest import Server

pytestmark = pytest.mark.databases("sqlite")

OPERATOR = "operator:op"
NORTH, SOUTH = "http://north", "http://south"

#: A server with a network whose missions are over.
IDLE = CellWork(
    cell_url=NORTH,
    network_ids=("texas",),
    open_missions=0,
    held_offers=0,
    unsent=0,
    rows={"missions": 2, "custody": 4},
    revision="0016",
    seal_id="sea_1",
)


def work(**changes: Any) -> CellWork:
    return IDLE.model_copy(update=changes)


EMPTY = work(network_ids=(), rows={"missions": 0, "custody": 0}, seal_id=None)
#: A server with a copy of that server's database.
COPY = work(cell_url=SOUTH, seal_id=None, copied_seal_id="sea_1")


@pytest.fixture(autouse=True)
def north(compositions: dict[str, Server]) -> Server:
    """The server of a new cell; the default server has no network."""
    compositions["composition"].work = work(cell_url=None, network_ids=())
    compositions["north"].work = EMPTY
    return compositions["north"]


@pytest.fixture
def south(compositions: dict[str, Server]) -> Server:
    """Another server, with a copy of the database of `north`."""
    compositions["south"].work = COPY
    return compositions["south"]


async def add(api: Any, network_id: str = "texas", *, url: str = NORTH) -> Any:
    return await api(OPERATOR, "PUT", f"/v1/cells/{network_id}", {"url": url})


@pytest.fixture
def close(api: Any) -> Any:
    """Closes a cell."""

    async def closed(network_id: str = "texas") -> None:
        path = f"/v1/cells/{network_id}"
        answer = await api(OPERATOR, "PATCH", path, {"state": "CLOSED"})
        assert answer.status_code == 200, answer.text

    return closed


async def move(api: Any, *, url: str = SOUTH) -> Any:
    return await api(OPERATOR, "POST", "/v1/cells/texas/moves", {"url": url})


async def table(api: Any) -> Any:
    answer = await api(None, "GET", "/internal/cells")
    return [(each["network_id"], each["url"], each["state"]) for each in answer.json()["cells"]]


async def test_a_new_cell_is_open_and_added_once(api: Any, servers: CellClients) -> None:
    first, again = await add(api), await add(api)

    # The registry itself asks the new server from now on.
    assert servers.of(NetworkId("texas")).url == NORTH

    assert first.status_code == again.status_code == 200
    assert first.json() == again.json()
    assert await table(api) == [("texas", NORTH, "OPEN")]
    listed = await api(OPERATOR, "GET", "/v1/cells")
    assert listed.json()["items"] == [first.json()]


async def test_only_operators_change_the_table(api: Any) -> None:
    refused = await api("provider:prv_1", "PUT", "/v1/cells/texas", {"url": NORTH})

    assert refused.status_code == 403
    assert (await api("customer:alice", "GET", "/v1/cells")).status_code == 403


@pytest.mark.parametrize("url", ["north:8002", "http://north/", "http://nor th", "ftp://north"])
async def test_a_text_that_is_no_address_is_refused(api: Any, url: str) -> None:
    assert (await add(api, url=url)).status_code == 422


@pytest.mark.parametrize(
    "url",
    [
        "http://evil",
        "http://north.evil",
        "http://so.evil",
        "http://so\u3002evil",
        "http://north:80@evil",
    ],
)
async def test_a_host_that_the_deployment_does_not_name_never_gets_a_secret(
    api: Any, compositions: dict[str, Server], url: str
) -> None:
    hosts = ("evil", "north.evil", "so.evil")
    compositions.update({host: Server(work(cell_url=url)) for host in hosts})

    refused = await add(api, url=url)

    assert refused.status_code == 422
    assert "SKYWAY_CELL_HOSTS" in refused.json()["detail"]
    assert [compositions[host].asked for host in hosts] == [0, 0, 0]


async def test_an_unknown_cell_cannot_be_closed_or_moved(api: Any) -> None:
    closed = await api(OPERATOR, "PATCH", "/v1/cells/texas", {"state": "CLOSED"})
    assert closed.status_code == 404
    assert "skyway cell list shows all" in closed.json()["detail"]
    assert (await move(api)).status_code == 404


async def test_a_server_that_does_not_answer_is_refused(api: Any, north: Server) -> None:
    north.work = None

    refused = await add(api)

    assert refused.status_code == 503
    assert NORTH in refused.json()["detail"]


async def test_a_server_must_know_its_own_address(api: Any, north: Server) -> None:
    north.work = work(cell_url=None)

    refused = await add(api)

    assert (refused.status_code, refused.json()["code"]) == (409, "WRONG_SERVER")
    assert "SKYWAY_CELL_URL" in refused.json()["detail"]


@pytest.mark.parametrize("is_before_cells", [True, False])
async def test_a_server_of_an_older_version_is_refused(
    api: Any, north: Server, is_before_cells: bool
) -> None:
    north.work = work(revision=None)
    north.is_unknown = is_before_cells

    refused = await add(api)

    assert (refused.status_code, refused.json()["code"]) == (409, "OTHER_VERSION")
    assert "upgrade the server" in refused.json()["detail"]


async def test_a_cell_for_a_network_published_elsewhere_is_refused(
    api: Any, compositions: dict[str, Server]
) -> None:
    compositions["composition"].work = work(cell_url="http://composition")

    refused = await add(api)
    accepted = await add(api, url="http://composition")

    assert (refused.status_code, refused.json()["code"]) == (409, "NETWORK_ELSEWHERE")
    assert accepted.status_code == 200


async def test_another_address_is_refused_with_the_command_that_moves(api: Any) -> None:
    await add(api)

    refused = await add(api, url=SOUTH)

    assert (refused.status_code, refused.json()["code"]) == (409, "CELL_EXISTS")
    assert "skyway cell move texas --to http://south" in refused.json()["detail"]


async def test_an_idle_closed_cell_moves_and_is_open(
    api: Any, close: Any, north: Server, south: Server, db: Database
) -> None:
    before = (await add(api)).json()
    north.work = IDLE
    await close()

    moved = await move(api)

    assert moved.status_code == 200, moved.text
    assert moved.json()["generation"] > before["generation"]
    assert await table(api) == [("texas", SOUTH, "OPEN")]
    assert (await move(api)).json() == moved.json()
    assert await broken_rules(db, RULES) == []


async def test_an_open_cell_does_not_move(api: Any, north: Server, south: Server) -> None:
    await add(api)
    north.work = IDLE

    refused = await move(api)

    assert (refused.status_code, refused.json()["code"]) == (409, "CELL_OPEN")
    assert "skyway cell close texas" in refused.json()["detail"]


@pytest.mark.parametrize(
    ("changes", "code"),
    [
        ({"open_missions": 2}, "CELL_BUSY"),
        ({"held_offers": 1}, "CELL_BUSY"),
        ({"unsent": 1}, "CELL_BUSY"),
        ({"network_ids": ("texas", "ohio")}, "CELL_NOT_ALONE"),
        ({"rows": {"missions": 3, "custody": 4}}, "CELL_NOT_COPIED"),
        ({"seal_id": None}, "CELL_NOT_SEALED"),
        ({"seal_id": "sea_2"}, "CELL_NOT_COPIED"),
        ({"revision": "0015"}, "OTHER_VERSION"),
        ({"revision": None, "seal_id": None}, "OTHER_VERSION"),
    ],
)
async def test_a_cell_with_work_or_without_a_copy_does_not_move(
    api: Any, close: Any, north: Server, south: Server, changes: dict[str, Any], code: str
) -> None:
    await add(api)
    north.work = work(**changes)
    await close()

    refused = await move(api)

    assert (refused.status_code, refused.json()["code"]) == (409, code)
    assert await table(api) == [("texas", NORTH, "CLOSED")]


async def test_a_cell_does_not_move_to_a_server_of_other_networks_with_as_many_rows(
    api: Any, close: Any, north: Server, south: Server
) -> None:
    await add(api)
    north.work, south.work = IDLE, COPY.model_copy(update={"network_ids": ("ohio",)})
    await close()

    refused = await move(api)

    assert (refused.status_code, refused.json()["code"]) == (409, "CELL_NOT_COPIED")
    assert "texas" in refused.json()["detail"]
    assert "ohio" in refused.json()["detail"]


async def test_a_cell_does_not_open_while_its_database_is_sealed(
    api: Any, close: Any, north: Server
) -> None:
    await add(api)
    north.work = IDLE
    await close()

    refused = await api(OPERATOR, "PATCH", "/v1/cells/texas", {"state": "OPEN"})
    north.work = work(seal_id=None)
    opened = await api(OPERATOR, "PATCH", "/v1/cells/texas", {"state": "OPEN"})

    assert (refused.status_code, refused.json()["code"]) == (409, "CELL_SEALED")
    assert "skyway cell unseal" in refused.json()["detail"]
    assert (opened.json()["state"], opened.json()["closed_at"]) == ("OPEN", None)


@pytest.mark.databases("sqlite", "postgresql")
async def test_the_networks_of_one_server_move_together(
    api: Any, close: Any, north: Server, south: Server
) -> None:
    await add(api)
    await add(api, "ohio")
    north.work = work(network_ids=("ohio", "texas"))
    south.work = COPY.model_copy(update={"network_ids": ("ohio", "texas")})
    await close()

    refused = await move(api)
    await close("ohio")
    moved = await move(api)

    assert refused.json()["code"] == "CELL_OPEN"
    assert moved.status_code == 200
    assert await table(api) == [("ohio", SOUTH, "OPEN"), ("texas", SOUTH, "OPEN")]


@pytest.mark.databases("sqlite", "postgresql")
async def test_a_drone_does_not_change_its_cell(api: Any, db: Database, stations: Any) -> None:
    drone = await api.drone(await api.provider())
    stations.elsewhere = {"mcqueeney": "ohio"}
    path = f"/v1/providers/{drone['provider_id']}/drones/{drone['drone_id']}"
    await add(api, "ohio")

    refused = await api(OPERATOR, "PATCH", path, {"home_station_id": "mcqueeney"})

    assert (refused.status_code, refused.json()["code"]) == (409, "OTHER_CELL")
    stations.elsewhere = {}
    accepted = await api(OPERATOR, "PATCH", path, {"home_station_id": "mcqueeney"})
    assert accepted.status_code == 200


async def test_with_a_hundred_cells_a_move_changes_the_cells_of_its_server_only(
    api: Any, close: Any, north: Server, south: Server, db: Database
) -> None:
    await add(api)
    others = [f"region-{number:03}" for number in range(99)]
    async with db.write() as tx:
        for number, name in enumerate(others, start=2):
            row = {"network_id": name, "url": f"http://{name}", "state": "OPEN"}
            await tx.execute(cells.insert().values({**row, "generation": number}))
    north.work = IDLE
    await close()

    # The servers of the other cells are away, and a move does not ask them.
    moved = await move(api)

    assert moved.status_code == 200, moved.text
    assert await table(api) == [
        *((name, f"http://{name}", "OPEN") for name in others),
        ("texas", SOUTH, "OPEN"),
    ]
    assert moved.json()["generation"] == 102
    assert await broken_rules(db, RULES) == []
