"""On PostgreSQL a transaction begins with its first statement; a single one needs no BEGIN."""

import pytest
from asyncpg.connection import LoggedQuery
from sqlalchemy import Column, Integer, MetaData, Table, Text, func, insert, select

from skyway.runtime.errors import RowRefused
from skyway.runtime.sql.database import Database, Tx

METADATA = MetaData()
CRATES = Table(
    "crates", METADATA, Column("name", Text, primary_key=True), Column("number", Integer)
)
LABELS = Table("labels", METADATA, Column("label", Text, primary_key=True))
OAK, PINE, ELM = ({"name": name, "number": 1} for name in ("oak", "pine", "elm"))

pytestmark = pytest.mark.parametrize(
    "database_url", [pytest.param("postgresql", marks=pytest.mark.integration)], indirect=True
)


@pytest.fixture
async def db(database: Database) -> Database:
    async with database.write() as tx:
        await tx.connection.run_sync(METADATA.create_all)
        await tx.execute(insert(CRATES), OAK)
    return database


async def listen(tx: Tx) -> list[str]:
    """What is said to the server between statements, on the connection that is lent next, too."""
    said: list[str] = []

    def note(query: LoggedQuery) -> None:
        said.append(query.query)

    driver = (await tx.connection.get_raw_connection()).driver_connection
    assert driver is not None
    driver.add_query_logger(note)
    return said


async def names(db: Database) -> list[str]:
    async with db.read() as connection:
        return list((await connection.execute(select(CRATES.c.name).order_by("name"))).scalars())


async def test_a_block_without_statements_says_nothing(db: Database) -> None:
    async with db.write() as tx:
        said = await listen(tx)
    async with db.write():
        pass
    assert await names(db) == ["oak"]

    assert said == []


async def test_a_block_that_only_adds_neither_begins_nor_commits(db: Database) -> None:
    async with db.write() as tx:
        said = await listen(tx)
        tx.add(CRATES, [PINE, ELM])
        tx.add(LABELS, [{"label": "fragile"}])
    assert await names(db) == ["elm", "oak", "pine"]

    assert {"BEGIN", "COMMIT"}.isdisjoint(said)


async def test_a_refused_row_of_a_block_that_only_adds_undoes_all_of_it(db: Database) -> None:
    async def add() -> None:
        async with db.write() as tx:
            tx.add(LABELS, [{"label": "fragile"}])
            tx.add(CRATES, [PINE, OAK])

    with pytest.raises(RowRefused, match="crates_pkey"):
        await add()
    async with db.read() as connection:
        labels = (await connection.execute(select(func.count()).select_from(LABELS))).scalar_one()
    assert (await names(db), labels) == (["oak"], 0)


async def test_a_refused_added_row_undoes_earlier_statements(db: Database) -> None:
    async def run_and_add() -> None:
        async with db.write() as tx:
            await tx.execute(insert(CRATES), PINE)
            tx.add(CRATES, [OAK])

    with pytest.raises(RowRefused, match="crates_pkey"):
        await run_and_add()
    assert await names(db) == ["oak"]


async def test_sql_by_hand_is_part_of_the_transaction(db: Database) -> None:
    async def give_up() -> None:
        async with db.write() as tx:
            await tx.connection.exec_driver_sql("INSERT INTO crates VALUES ('pine', 1)")
            raise RuntimeError("thought better of it")

    with pytest.raises(RuntimeError, match="thought better"):
        await give_up()
    assert await names(db) == ["oak"]
