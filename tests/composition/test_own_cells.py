"""A server of composition serves only its own networks, and its idle database can be copied."""

from collections.abc import Awaitable, Callable
from typing import Any

import pytest
from skyway_composition.cell_store import rows
from skyway_composition.copy_store import copy_database
from skyway_composition.own_cells import OwnCells, OwnDrones
from skyway_composition.tables import closures, outbox, replicas
from sqlalchemy import text

from skyway.cells import Cells
from skyway.contracts.cells import CELL_HEADER, CELL_WORK, CellTable, CellWork, NetworkCell
from skyway.contracts.mission import BookMissions
from skyway.contracts.shortlist import Shortlist
from skyway.errors import SkywayError
from skyway.ids import DroneId, NetworkId
from skyway.runtime.sql.database import Database
from skyway.runtime.sql.migrations import migrate

OPERATOR = "operator:op"
OURS, OTHERS = "http://ours", "http://others"
ROW = NetworkId("row")

Serve = Callable[..., Awaitable[OwnCells]]


def cell(url: str = OURS, *, generation: int = 2, is_open: bool = True) -> NetworkCell:
    state = "OPEN" if is_open else "CLOSED"
    return NetworkCell.model_validate(
        {"network_id": ROW, "url": url, "state": state, "generation": generation}
    )


@pytest.fixture
def wall() -> dict[str, float]:
    """Seconds of the clock that measures the age of the table."""
    return {"s": 0.0}


@pytest.fixture
def serve(composition: Any, wall: dict[str, float]) -> Serve:
    """Gives the server a table of cells, as it would read it from the registry."""

    async def given(*cells: NetworkCell, is_default: bool = False) -> OwnCells:
        async def read() -> CellTable:
            return CellTable(cells=cells)

        own: OwnCells = composition.parts.own_cells
        own.cells = Cells(read, now=lambda: wall["s"])
        own.url, own.is_default = OURS, is_default
        await own.cells.refresh()
        return own

    return given


async def read_network(composition: Any, header: str) -> Any:
    return await composition(OPERATOR, "GET", "/v1/networks/row", **{CELL_HEADER: header})


async def quote(composition: Any, header: str) -> Any:
    headers = {CELL_HEADER: header}
    return await composition("service:gateway", "POST", "/internal/quotes", {}, **headers)


async def test_a_request_for_an_own_network_is_answered(composition: Any, serve: Serve) -> None:
    await serve(cell())

    assert (await read_network(composition, "row;2")).status_code == 200
    # The entrance admits the request; then its empty body is refused.
    assert (await quote(composition, "row;2")).status_code == 422


@pytest.mark.parametrize(
    ("cells", "header", "reason"),
    [
        ((cell(OTHERS),), "row;2", "served by http://others"),
        ((), "row;2", "served by the server of networks without a cell"),
        ((cell(generation=5),), "row;2", "read the table again"),
    ],
)
async def test_a_request_that_follows_an_old_or_foreign_row_is_refused(
    composition: Any, serve: Serve, cells: tuple[NetworkCell, ...], header: str, reason: str
) -> None:
    await serve(*cells)

    refused = await read_network(composition, header)

    assert refused.status_code == 421
    assert reason in refused.json()["detail"]


async def test_a_server_reads_the_table_when_a_request_names_a_newer_row(
    composition: Any, serve: Serve
) -> None:
    tables = [CellTable(cells=()), CellTable(cells=(cell(generation=4),))]
    own = await serve()

    async def read() -> CellTable:
        return tables.pop(0)

    own.cells = Cells(read)
    await own.cells.refresh()

    assert (await read_network(composition, "row;4")).status_code == 200


async def test_a_header_of_another_form_is_refused(composition: Any, serve: Serve) -> None:
    await serve(cell())

    for header in ("row", "row;", "row;x", ";2", "a b;2"):
        assert (await read_network(composition, header)).status_code == 422, header


async def test_a_network_is_published_only_at_its_own_server(
    composition: Any, serve: Serve, make: Any
) -> None:
    await serve(cell(OTHERS), is_default=True)
    elsewhere = await composition(OPERATOR, "PUT", "/v1/networks/row", make.network())
    without = await composition(OPERATOR, "PUT", "/v1/networks/new", make.network(stations="xyz"))
    await serve(cell(OTHERS))
    of_default = await composition(OPERATOR, "PUT", "/v1/networks/new", make.network())

    assert (elsewhere.status_code, without.status_code, of_default.status_code) == (421, 201, 421)


async def test_a_closed_cell_accepts_no_new_request_and_answers_others(
    composition: Any, serve: Serve
) -> None:
    await serve(cell(is_open=False))

    refused = await quote(composition, "row;2")

    assert refused.status_code == 503
    assert "the cell row is unavailable: it is closed" in refused.json()["detail"]
    assert (await read_network(composition, "row;2")).status_code == 200


async def test_a_cell_that_cannot_read_the_table_accepts_no_new_request(
    composition: Any, serve: Serve, wall: dict[str, float]
) -> None:
    await serve(cell())
    wall["s"] += 11.0

    assert (await quote(composition, "row;2")).status_code == 503
    assert (await read_network(composition, "row;2")).status_code == 200


@pytest.mark.parametrize(
    ("row", "status"),
    [(cell(OTHERS), 421), (cell(is_open=False), 503), (cell(), 200), (None, 200)],
)
async def test_a_gateway_that_has_not_read_the_row_of_a_network_books_only_at_its_open_server(
    composition: Any, serve: Serve, make: Any, row: NetworkCell | None, status: int
) -> None:
    elsewhere = cell(OTHERS).model_copy(update={"network_id": NetworkId("north")})
    await serve(*([elsewhere] if row is None else [row]), is_default=True)
    booking = BookMissions(
        attempt=1, request=make.request("c"), shortlist=Shortlist.of([make.candidate()])
    )

    answer = await composition(
        "service:gateway",
        "PUT",
        "/internal/deliveries/dlv_1/missions",
        booking.model_dump(mode="json"),
    )

    assert answer.status_code == status, answer.text
    missions = await composition.rows("SELECT mission_id FROM missions")
    assert bool(missions) == (status == 200)


class Everything:
    """A `Reception` that reads the messages of every drone."""

    def is_ours(self, ids: tuple[str, ...]) -> bool:
        return True

    def is_shut_out(self, ids: tuple[str, ...]) -> bool:
        return False

    def unreadable(self, *_: object) -> None: ...
    def forged(self, *_: object) -> None: ...
    def postponed(self, *_: object) -> None: ...


async def test_messages_of_drones_of_other_cells_are_dropped(serve: Serve) -> None:
    own = await serve(cell(OTHERS), is_default=True)
    drones = OwnDrones(Everything(), own)
    for drone_id, network_id in (("drn_1", "row"), ("drn_2", "south"), ("drn_3", None)):
        own.note_home(DroneId(drone_id), NetworkId(network_id) if network_id else None)

    are_ours = [drones.is_ours(("prv_1", f"drn_{n}")) for n in range(1, 5)]
    assert are_ours == [False, True, True, True]
    await serve(cell(OURS))
    assert drones.is_ours(("prv_1", "drn_1"))
    assert not drones.is_ours(("prv_1", "drn_2"))


async def work(composition: Any) -> CellWork:
    registry = {"Authorization": "Bearer secret of registry"}
    answer = await composition(None, "GET", CELL_WORK, **registry)
    assert answer.status_code == 200, answer.text
    return CellWork.read(answer.content)


async def test_the_work_of_a_server_names_missions_messages_and_rows(composition: Any) -> None:
    idle = await work(composition)
    await composition.book()
    busy = await work(composition)

    assert (idle.network_ids, idle.open_missions, idle.unsent) == (("row",), 0, 0)
    assert (busy.open_missions, busy.rows["missions"]) == (1, 1)
    assert busy.unsent > 0


async def test_a_copy_has_every_row_and_can_be_repeated(
    composition: Any, sqlite_url: str, package: str
) -> None:
    target_url = f"{sqlite_url}.copy"
    await migrate(target_url, package)
    async with Database(target_url, outbox=outbox) as target:
        for _ in range(2):
            await copy_database(composition.db, target)

            async with composition.db.read() as source, target.read() as copied:
                assert await rows(copied) == await rows(source)
            body = {"until": None, "reason": "roof"}
            await composition(OPERATOR, "POST", "/v1/stations/b/closures", body)


async def test_a_busy_server_is_not_copied_and_other_data_is_not_replaced(
    composition: Any, sqlite_url: str, package: str
) -> None:
    target_url = f"{sqlite_url}.copy"
    await migrate(target_url, package)
    async with Database(target_url, outbox=outbox) as target:
        async with target.write() as tx:
            await tx.execute(
                text(
                    "INSERT INTO networks (network_id, version, sha256, published_ms) "
                    "VALUES ('mine', 1, '', 0)"
                )
            )
        with pytest.raises(SkywayError, match="mine"):
            await copy_database(composition.db, target)
    await composition.book()
    async with Database(f"{sqlite_url}.other", outbox=outbox) as target:
        with pytest.raises(SkywayError, match="1 missions are not over"):
            await copy_database(composition.db, target)


async def test_a_copy_that_its_server_has_worked_with_is_not_replaced(
    composition: Any, sqlite_url: str, package: str
) -> None:
    target_url = f"{sqlite_url}.copy"
    await migrate(target_url, package)
    async with Database(target_url, outbox=outbox) as target:
        body = {"until": None, "reason": "roof"}
        await composition(OPERATOR, "POST", "/v1/stations/b/closures", body)
        await copy_database(composition.db, target)
        async with composition.db.write() as tx:
            await tx.execute(closures.delete())

        # The target has a closure that the source has not, as after a move.
        with pytest.raises(SkywayError, match="newer closures"):
            await copy_database(composition.db, target)


async def test_the_live_replicas_of_a_server_are_neither_copied_nor_compared(
    composition: Any, sqlite_url: str, package: str
) -> None:
    target_url = f"{sqlite_url}.copy"
    await migrate(target_url, package)
    seen = {"joined_wall_ms": 1, "seen_wall_ms": 1, "is_listening": True}
    async with Database(target_url, outbox=outbox) as target:
        for db, replica_ids in ((composition.db, ("a", "b")), (target, ("c",))):
            async with db.write() as tx:
                for each in replica_ids:
                    await tx.execute(replicas.insert().values(replica_id=each, **seen))

        await copy_database(composition.db, target)

        async with composition.db.read() as source, target.read() as copied:
            assert await rows(copied) == await rows(source)
            assert (await copied.execute(replicas.select())).one().replica_id == "c"
