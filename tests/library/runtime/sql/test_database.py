"""A database is used in the same way on SQLite and PostgreSQL."""

import asyncio
import contextlib

import pytest
from sqlalchemy import Column, Integer, MetaData, Table, Text, func, select, text
from sqlalchemy.exc import DBAPIError

from skyway.runtime.errors import RowRefused, ServiceUnavailable
from skyway.runtime.sql.database import Database

METADATA = MetaData()
STATIONS = Table(
    "stations",
    METADATA,
    Column("id", Integer, primary_key=True),
    Column("name", Text, nullable=False, unique=True),
)


@pytest.fixture
async def db(database: Database) -> Database:
    async with database.write() as tx:
        await tx.connection.run_sync(METADATA.create_all)
    return database


async def names(db: Database) -> list[str]:
    async with db.read() as connection:
        return list((await connection.execute(select(STATIONS.c.name))).scalars())


async def add(db: Database, *found: str) -> None:
    async with db.write() as tx:
        for name in found:
            await tx.execute(STATIONS.insert(), {"name": name})


async def test_a_reader_sees_a_block_after_it_ended(db: Database) -> None:
    await add(db, "san-marcos", "bulverde")

    assert await names(db) == ["san-marcos", "bulverde"]


async def test_a_rehearsal_sees_its_changes_and_leaves_nothing(db: Database) -> None:
    async with db.rehearse() as tx:
        await tx.execute(STATIONS.insert(), {"name": "san-marcos"})
        found = await tx.connection.execute(select(func.count()).select_from(STATIONS))
        assert found.scalar_one() == 1

    assert await names(db) == []
    await add(db, "san-marcos")
    assert await names(db) == ["san-marcos"]


async def test_an_error_in_a_rehearsal_is_raised(db: Database) -> None:
    with pytest.raises(LookupError):
        async with db.rehearse():
            raise LookupError


#: Half a second of work for SQLite, and not much less for PostgreSQL.
LONG = text(
    "WITH RECURSIVE up(n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM up WHERE n < 1000000)"
    " SELECT max(n) FROM up"
)


async def test_others_go_on_while_a_survey_runs(db: Database) -> None:
    async def survey() -> object:
        async with db.survey() as connection:
            return (await connection.execute(LONG)).scalar_one()

    surveying = asyncio.create_task(survey())
    await add(db, "san-marcos")
    still_runs = not surveying.done()

    assert await surveying == 1_000_000
    assert still_runs


async def test_a_survey_cannot_write(db: Database) -> None:
    async with db.survey() as connection:
        with pytest.raises(DBAPIError):
            await connection.execute(STATIONS.insert().values(name="san-marcos"))


async def test_a_block_that_fails_leaves_nothing(db: Database) -> None:
    async def fail() -> None:
        async with db.write() as tx:
            await tx.execute(STATIONS.insert(), {"name": "san-marcos"})
            raise LookupError

    with pytest.raises(LookupError):
        await fail()

    assert await names(db) == []


async def test_a_cancelled_block_leaves_nothing(db: Database) -> None:
    wrote = asyncio.Event()

    async def write_and_linger() -> None:
        async with db.write() as tx:
            await tx.execute(STATIONS.insert(), {"name": "san-marcos"})
            wrote.set()
            await asyncio.Event().wait()

    writing = asyncio.create_task(write_and_linger())
    await wrote.wait()
    writing.cancel()
    await asyncio.gather(writing, return_exceptions=True)
    await add(db, "bulverde")

    assert await names(db) == ["bulverde"]


@pytest.mark.parametrize("ending", ["commit", "rollback"])
async def test_a_block_cannot_end_its_transaction_by_itself(db: Database, ending: str) -> None:
    async def end_early() -> None:
        async with db.write() as tx:
            await tx.execute(STATIONS.insert(), {"name": "san-marcos"})
            await getattr(tx.connection, ending)()

    with pytest.raises(RuntimeError, match="a write block"):
        await end_early()

    assert await names(db) == []


async def test_an_error_in_a_statement_fails_the_block_even_when_it_is_caught(
    db: Database,
) -> None:
    async def go_on_regardless() -> None:
        async with db.write() as tx:
            await tx.execute(STATIONS.insert(), {"name": "san-marcos"})
            with contextlib.suppress(RowRefused):
                await tx.execute(STATIONS.insert(), {"name": "san-marcos"})

    with pytest.raises(RowRefused):
        await go_on_regardless()

    assert await names(db) == []


async def test_a_connection_to_read_cannot_write(db: Database) -> None:
    with pytest.raises(DBAPIError):
        async with db.read() as connection:
            await connection.execute(STATIONS.insert(), {"name": "san-marcos"})

    assert await names(db) == []


@pytest.mark.parametrize(
    "database_url", [pytest.param("postgresql", marks=pytest.mark.integration)], indirect=True
)
async def test_each_statement_of_a_reader_is_its_own_transaction(db: Database) -> None:
    async with db.read() as connection:
        # What now() says is the moment at which the transaction began.
        moments = [(await connection.execute(text("SELECT now()"))).scalar_one() for _ in range(2)]

    assert moments[0] < moments[1]


async def test_a_reader_does_not_see_an_open_block(db: Database) -> None:
    async with db.write() as tx:
        await tx.execute(STATIONS.insert(), {"name": "san-marcos"})
        during = await names(db)

    assert during == []
    assert await names(db) == ["san-marcos"]


async def test_callbacks_are_called_after_the_commit_only(db: Database) -> None:
    called: list[str] = []

    async def fail() -> None:
        async with db.write() as tx:
            tx.after_commit(lambda: called.append("failed"))
            raise LookupError

    with pytest.raises(LookupError):
        await fail()
    async with db.write() as tx:
        tx.after_commit(lambda: called.append("kept"))
        before = list(called)

    assert before == []
    assert called == ["kept"]


async def test_an_insert_may_meet_a_row_that_is_there(db: Database) -> None:
    await add(db, "san-marcos")

    async with db.write() as tx:
        again = tx.insert(STATIONS).values(name="san-marcos").on_conflict_do_nothing()
        done = await tx.execute(again)

    assert done.rowcount == 0
    assert await names(db) == ["san-marcos"]


async def test_concurrent_blocks_are_all_kept(db: Database) -> None:
    await asyncio.gather(*(add(db, f"station-{number}") for number in range(50)))

    async with db.read() as connection:
        counted = await connection.execute(select(func.count()).select_from(STATIONS))
        assert counted.scalar() == 50


async def test_a_database_that_is_closed_says_so(database_url: str) -> None:
    db = Database(database_url)
    async with db:
        assert await db.is_answering()

    assert not await db.is_answering()
    with pytest.raises(ServiceUnavailable):
        async with db.write():
            pass


async def test_a_database_can_be_opened_again(database_url: str) -> None:
    db = Database(database_url)
    async with db:
        pass

    async with db:
        assert await db.is_answering()


async def test_a_server_that_is_not_there_is_unavailable(tmp_path: object) -> None:
    async with Database(f"postgresql://skyway@/none?host={tmp_path}") as db:
        answering = await db.is_answering()

        with pytest.raises(ServiceUnavailable):
            async with db.write() as tx:
                await tx.execute(text("SELECT 1"))

    assert not answering


@pytest.mark.parametrize(
    "database_url", [pytest.param("postgresql", marks=pytest.mark.integration)], indirect=True
)
async def test_connections_that_the_server_closed_are_replaced(database_url: str) -> None:
    async with Database(database_url) as db, Database(database_url) as other:
        async with db.read() as connection:
            before = (await connection.execute(text("SELECT pg_backend_pid()"))).scalar_one()
            driver = (await connection.get_raw_connection()).driver_connection
        assert driver is not None
        is_closed = asyncio.Event()
        driver.add_termination_listener(lambda _: is_closed.set())
        async with other.write() as tx:
            await tx.execute(text("SELECT pg_terminate_backend(:pid)"), {"pid": before})
        async with asyncio.timeout(60):
            await is_closed.wait()

        async with db.read() as connection:
            after = (await connection.execute(text("SELECT pg_backend_pid()"))).scalar_one()

    assert after != before


async def test_write_alone_stores_and_returns_its_rows(db: Database) -> None:
    adding = STATIONS.insert().returning(STATIONS.c.name)

    added = await db.write_alone(adding, {"name": "san-marcos"})
    await db.write_alone(STATIONS.insert(), [{"name": "bulverde"}, {"name": "boerne"}])

    assert [row.name for row in added] == ["san-marcos"]
    assert await names(db) == ["san-marcos", "bulverde", "boerne"]


async def test_a_block_after_write_alone_is_still_one_transaction(db: Database) -> None:
    async def fail() -> None:
        async with db.write() as tx:
            await tx.execute(STATIONS.insert(), {"name": "bulverde"})
            raise LookupError

    await db.write_alone(STATIONS.insert(), {"name": "san-marcos"})
    with pytest.raises(LookupError):
        await fail()

    assert await names(db) == ["san-marcos"]


async def test_write_alone_that_fails_half_way_leaves_nothing(db: Database) -> None:
    with pytest.raises((DBAPIError, RowRefused)):
        await db.write_alone(STATIONS.insert(), [{"name": "san-marcos"}, {"name": "san-marcos"}])

    assert await names(db) == []
