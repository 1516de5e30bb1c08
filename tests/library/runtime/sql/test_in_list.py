"""Rows are found by lists of values, with one SQL text for all lengths."""

from types import ModuleType

import pytest
from sqlalchemy import BigInteger, Column, MetaData, Table, Text, bindparam, delete, select
from sqlalchemy.dialects import postgresql, sqlite

from skyway.runtime.sql.database import Database
from skyway.runtime.sql.in_list import in_list

METADATA = MetaData()
DRONES = Table(
    "drones",
    METADATA,
    Column("drone_id", Text, primary_key=True),
    Column("number", BigInteger, nullable=False),
)
NAMED = (
    select(DRONES.c.drone_id).where(in_list(DRONES.c.drone_id, "ids")).order_by(DRONES.c.drone_id)
)


@pytest.fixture
async def db(database: Database) -> Database:
    async with database.write() as tx:
        await tx.connection.run_sync(METADATA.create_all)
        rows = [{"drone_id": each, "number": n} for n, each in enumerate(["a", "b", 'c"', "d"])]
        await tx.execute(DRONES.insert(), rows)
    return database


@pytest.mark.parametrize("requested", [[], ["a"], ['c"', "a", "z"], ["a", "a", "b", "d"]])
async def test_rows_in_the_list_are_found(db: Database, requested: list[str]) -> None:
    async with db.read() as connection:
        found = await connection.execute(NAMED, {"ids": requested})

        assert [*found.scalars()] == sorted({*requested} - {"z"})


async def test_numbers_are_found_by_lists_of_numbers(db: Database) -> None:
    query = select(DRONES.c.drone_id).where(in_list(DRONES.c.number, "numbers"))

    async with db.read() as connection:
        found = await connection.execute(query, {"numbers": [3, 2**62]})

        assert [*found.scalars()] == ["d"]


async def test_rows_of_a_list_are_deleted(db: Database) -> None:
    async with db.write() as tx:
        gone = await tx.execute(
            delete(DRONES).where(in_list(DRONES.c.drone_id, "ids")), {"ids": ["a", "d"]}
        )

    assert gone.rowcount == 2


async def test_lists_of_any_length_go_with_other_parameters(db: Database) -> None:
    query = NAMED.where(DRONES.c.number > bindparam("above"))

    async with db.read() as connection:
        found = await connection.execute(
            query, {"ids": [str(n) for n in range(40_000)] + ["b"], "above": 0}
        )

        assert [*found.scalars()] == ["b"]


@pytest.mark.parametrize("dialect", [postgresql, sqlite])
def test_the_list_is_a_single_parameter(dialect: ModuleType) -> None:
    assert [*NAMED.compile(dialect=dialect.dialect()).params] == ["ids"]


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
async def test_rows_are_found_by_the_index(db: Database) -> None:
    query = NAMED.where(DRONES.c.number > 0).compile(dialect=sqlite.dialect())

    async with db.read() as connection:
        found = await connection.exec_driver_sql(f"EXPLAIN QUERY PLAN {query}", ("[]", 0))

        assert "SEARCH drones" in str(found.all())


async def test_two_columns_have_statements_of_their_own(db: Database) -> None:
    texts = select(DRONES.c.number).where(in_list(DRONES.c.drone_id, "requested"))
    numbers = select(DRONES.c.number).where(in_list(DRONES.c.number, "requested"))

    async with db.read() as connection:
        by_text = await connection.execute(texts, {"requested": ["b"]})
        by_number = await connection.execute(numbers, {"requested": [2]})

        assert [*by_text.scalars()] == [1]
        assert [*by_number.scalars()] == [2]
