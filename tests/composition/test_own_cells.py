"""A server of composition serves only its own networks, and its idle database can be copied."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import pytest
from skyway_composition.cell_store import rows
from skyway_composition.copy_store import copy_database
from skyway_composition.own_cells import OwnCells, OwnDrones
from skyway_composition.seal_store import seal, seal_id, unseal
from skyway_composition.tables import closures, networks, outbox, replicas
from sqlalchemy import select, text

from skyway.cells import Cells
from skyway.contracts.cells import CELL_HEADER, CELL_WORK, CellTable, CellWork, NetworkCell
from skyway.contracts.mission import BookMissions
from skyway.contracts.shortlist import Shortlist
from skyway.errors import SkywayError
from skyway.ids import DroneId, NetworkId
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.sql.database import Database
from skyway.runtime.sql.migrations import migrate

OPERATOR, GATEWAY = "operator:op", "service:gateway"
BOOKING_PATH = "/internal/deliveries/dlv_1/missions"
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
def serve(unpublished: Any, wall: dict[str, float]) -> Serve:
    """Gives the server a table of cells, as it would read it from the registry."""

    async def given(*cells: NetworkCell, is_default: bool = False) -> OwnCells:
        async def read() -> CellTable:
            return CellTable(cells=cells)

        own: OwnCells = unpublished.parts.own_cells
        own.cells = Cells(read, now=lambda: wall["s"])
        own.url, own.is_default = OURS, is_default
        await own.cells.refresh()
        return own

    return given


def booking(make: Any) -> dict[str, Any]:
    return BookMissions(
        attempt=1, request=make.request("c"), shortlist=Shortlist.of([make.candidate()])
    ).model_dump(mode="json")


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

    answer = await composition(GATEWAY, "PUT", BOOKING_PATH, booking(make))

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
    own.networks = [NetworkId("south")]
    drones = OwnDrones(Everything(), own)
    for drone_id, network_id in (("drn_1", "row"), ("drn_2", "south"), ("drn_3", None)):
        own.note_home(DroneId(drone_id), NetworkId(network_id) if network_id else None)

    are_ours = [drones.is_ours(("prv_1", f"drn_{n}")) for n in range(1, 5)]
    assert are_ours == [False, True, True, True]
    await serve(cell(OURS))
    assert not drones.is_ours(("prv_1", "drn_4"))
    own.networks = [ROW]
    assert drones.is_ours(("prv_1", "drn_1"))
    assert not drones.is_ours(("prv_1", "drn_2"))


async def test_a_server_reads_drones_when_it_gets_its_first_network(
    unpublished: Any, serve: Any
) -> None:
    own = await serve(cell(OURS))
    drones = OwnDrones(Everything(), own)
    assert not await own.refresh(unpublished.db)
    assert not drones.is_ours(("prv_1", "drn_1"))

    await unpublished.publish()

    # Then the broker is asked for all retained states once more.
    assert await own.refresh(unpublished.db)
    assert drones.is_ours(("prv_1", "drn_1"))
    assert not await own.refresh(unpublished.db)


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
    async with composition.db.read() as connection:
        assert await seal_id(connection, "SEALED") is not None


async def close_station(composition: Any) -> Any:
    body = {"until": None, "reason": "roof"}
    return await composition(OPERATOR, "POST", "/v1/stations/b/closures", body)


async def test_a_copied_database_refuses_changes_until_it_is_unsealed(
    composition: Any, sqlite_url: str, package: str, make: Any
) -> None:
    target_url = f"{sqlite_url}.copy"
    await migrate(target_url, package)
    async with Database(target_url, outbox=outbox) as target:
        await copy_database(composition.db, target)

        closed = await close_station(composition)
        missions = await composition.rows("SELECT mission_id FROM missions")
        booked = await composition(GATEWAY, "PUT", BOOKING_PATH, booking(make))

        for refused in (closed, booked):
            assert refused.status_code == 503
            assert refused.json()["code"] == "CELL_SEALED"
            assert "after the move" in refused.json()["detail"]
        assert missions == await composition.rows("SELECT mission_id FROM missions")
        assert await composition.broken() == []
        assert (await read_network(composition, "row;0")).status_code == 421
        # The copy accepts changes. A copy back replaces the sealed database, which is free again.
        async with target.write() as tx:
            await tx.execute(closures.delete())
        await copy_database(target, composition.db)
        assert (await close_station(composition)).status_code == 201


@pytest.mark.parametrize(
    "migrated_url", [pytest.param("postgresql", marks=pytest.mark.integration)], indirect=True
)
async def test_a_transaction_that_began_before_the_seal_delays_the_seal_or_fails(
    composition: Any, migrated_url: str
) -> None:
    """A replica that is stopped in a transaction must not commit to a database that was copied."""
    new = {"network_id": "n", "version": 1, "sha256": "", "published_ms": 0}
    async with Database(migrated_url) as other:

        async def commit_late() -> None:
            async with composition.db.write() as late:
                await late.execute(select(networks))
                await seal(other)
                await late.execute(networks.insert(), new)

        with pytest.raises(ServiceUnavailable, match="sealed"):
            await commit_late()
        async with other.write() as tx:
            assert await unseal(tx)
        async with composition.db.write() as early:
            await early.execute(networks.insert(), new)
            with pytest.raises(SkywayError, match="a lock was not available"):
                await seal(other)

    assert len(await composition.rows("SELECT network_id FROM networks")) == 2


async def test_a_retired_server_refuses_requests_and_leaves_its_loops_out(
    composition: Any, serve: Serve
) -> None:
    steps = list[int]()

    async def step() -> bool:
        steps.append(1)
        return True

    own = await serve(cell(OTHERS), is_default=True)
    gained = await own.refresh(composition.db)
    refused = await composition(OPERATOR, "GET", "/v1/missions")
    assert (own.is_retired, gained) == (True, False)
    assert refused.status_code == 421
    assert "(row)" in refused.json()["detail"]
    assert (await work(composition)).network_ids == ("row",)
    assert not await own.while_active(step)()
    waiting = asyncio.create_task(own.until_active())

    async def moved_here() -> CellTable:
        return CellTable(cells=(cell(OURS, generation=3),))

    own.cells = Cells(moved_here)
    own.cells.put(CellTable(cells=(cell(OTHERS),)))
    own.is_sealed = True
    assert await own.refresh(composition.db)
    await waiting
    assert await own.while_active(step)()
    assert steps == [1]
    assert (await composition(OPERATOR, "GET", "/v1/missions")).status_code == 200


async def test_a_server_with_a_sealed_database_does_nothing_before_it_has_read_the_table(
    composition: Any, serve: Serve
) -> None:
    own: OwnCells = composition.parts.own_cells
    await own.read_database(composition.db)
    assert not own.is_retired

    await seal(composition.db)
    await own.read_database(composition.db)

    assert own.is_retired


async def test_a_database_of_another_revision_is_not_copied(
    composition: Any, sqlite_url: str, package: str
) -> None:
    target_url = f"{sqlite_url}.copy"
    await migrate(target_url, package)
    async with composition.db.write() as tx:
        await tx.execute(text("UPDATE alembic_version SET version_num = '0014'"))
    async with Database(target_url, outbox=outbox) as target:
        with pytest.raises(SkywayError, match=r"revision 0014.*upgrade that server first"):
            await copy_database(composition.db, target)

        async with Database(f"{sqlite_url}.nothing") as nothing:
            with pytest.raises(SkywayError, match="check its URL"):
                await copy_database(nothing, target)

    assert (await work(composition)).seal_id is None


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
    await migrate(f"{sqlite_url}.other", package)
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
            await unseal(tx)
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
