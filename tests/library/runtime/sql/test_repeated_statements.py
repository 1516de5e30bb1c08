"""Repeated statements give the same answer each time, on both dialects."""

import asyncio
from collections.abc import Callable
from typing import Any

import pytest
from sqlalchemy import (
    BigInteger,
    Boolean,
    Column,
    Double,
    Executable,
    Integer,
    LargeBinary,
    MetaData,
    Table,
    Text,
    bindparam,
    func,
    insert,
    select,
    text,
    update,
)
from sqlalchemy.exc import DBAPIError, MultipleResultsFound, NoResultFound, StatementError

from skyway.runtime.errors import RowRefused, ServiceUnavailable
from skyway.runtime.sql.database import Database
from skyway.runtime.sql.in_list import in_list

METADATA = MetaData()
CRATES = Table(
    "crates",
    METADATA,
    Column("name", Text, primary_key=True),
    Column("number", Integer, nullable=False),
    Column("at_ms", BigInteger),
    Column("mass_kg", Double),
    Column("is_heavy", Boolean),
    Column("seal", LargeBinary),
)
ADD = insert(CRATES)
THIS = select(CRATES).where(CRATES.c.name == bindparam("this"))
EVERY = select(CRATES.c.name).order_by(CRATES.c.number)

OAK = {
    "name": "oak",
    "number": 1,
    "at_ms": 2**40,
    "mass_kg": 2.5,
    "is_heavy": False,
    "seal": b"\x00\xff",
}
PINE = {"name": "pine", "number": 2, "at_ms": None, "mass_kg": None, "is_heavy": None, "seal": None}
#: As often as it takes to run a statement in every way there is, and once more.
TIMES = 5

ON_POSTGRESQL = pytest.mark.parametrize(
    "database_url", [pytest.param("postgresql", marks=pytest.mark.integration)], indirect=True
)


@pytest.fixture
async def db(database: Database) -> Database:
    async with database.write() as tx:
        await tx.connection.run_sync(METADATA.create_all)
        await tx.execute(ADD, [OAK, PINE])
    return database


async def found(db: Database, statement: Executable, **values: Any) -> list[Any]:
    """What a statement finds each time that it is run."""
    answers = []
    for _ in range(TIMES):
        async with db.read() as connection:
            answers.append((await connection.execute(statement, values)).all())
    return answers


async def test_rows_hold_the_same_values_each_time(db: Database) -> None:
    [oak], *others = await found(db, THIS, this="oak")

    assert oak._asdict() == OAK
    assert type(oak.seal) is bytes
    assert (oak.mass_kg, oak._mapping[CRATES.c.number]) == (2.5, 1)
    assert others == [[oak]] * (TIMES - 1)
    assert all(row._mapping[CRATES.c.number] == 1 for [row] in others)


async def test_null_is_none_each_time(db: Database) -> None:
    answers = await found(db, THIS, this="pine")

    assert [[row._asdict() for row in answer] for answer in answers] == [[PINE]] * TIMES


async def test_constants_of_a_statement_stay_in_it(db: Database) -> None:
    heavy = select(CRATES.c.name).where(
        CRATES.c.number.in_([1, 3]), CRATES.c.is_heavy == bindparam("heavy"), CRATES.c.name != "elm"
    )

    assert await found(db, heavy, heavy=False) == [[("oak",)]] * TIMES


async def test_a_list_may_have_any_length(db: Database) -> None:
    named = select(func.count()).where(in_list(CRATES.c.name, "names"))
    expanded = select(func.count()).where(CRATES.c.name.in_(bindparam("names", expanding=True)))

    for names, count in (([], 0), (["oak"], 1), (["oak", "pine", "elm"], 2)):
        assert await found(db, named, names=names) == [[(count,)]] * TIMES
        assert await found(db, expanded, names=names) == [[(count,)]] * TIMES


async def test_a_result_answers_in_every_form_each_time(db: Database) -> None:
    names = select(CRATES.c.name, CRATES.c.number.label("of")).where(
        CRATES.c.number <= bindparam("most")
    )
    for _ in range(TIMES):
        async with db.read() as connection:

            async def ask(most: int, *, on: Any = connection) -> Any:
                return await on.execute(names, {"most": most})

            assert list((await ask(2)).scalars()) == ["oak", "pine"]
            assert (await ask(2)).first().of == 1
            assert [row["of"] for row in (await ask(2)).mappings()] == [1, 2]
            assert [(await ask(1)).scalar_one(), (await ask(1)).scalar()] == ["oak", "oak"]
            assert [(await ask(0)).scalar_one_or_none(), (await ask(0)).scalar()] == [None, None]
            assert [(await ask(0)).one_or_none(), (await ask(0)).first()] == [None, None]
            assert (await ask(1)).one().name == "oak"
            with pytest.raises(NoResultFound):
                (await ask(0)).one()
            with pytest.raises(MultipleResultsFound):
                (await ask(2)).one()
            with pytest.raises(MultipleResultsFound):
                (await ask(2)).one_or_none()


async def test_an_update_counts_and_returns_each_time(db: Database) -> None:
    counting = (
        update(CRATES)
        .where(CRATES.c.name == bindparam("this"))
        .values(number=CRATES.c.number + bindparam("more"))
    )
    returning = counting.returning(CRATES.c.number)

    for turn in range(TIMES):
        async with db.write() as tx:
            assert (await tx.execute(counting, {"this": "oak", "more": 1})).rowcount == 1
            assert (await tx.execute(counting, {"this": "elm", "more": 1})).rowcount == 0
            number = await tx.execute(returning, {"this": "oak", "more": 9})
            assert number.scalar_one() == 11 + 10 * turn


async def test_one_row_and_many_are_added_each_time(db: Database) -> None:
    for turn in range(TIMES):
        async with db.write() as tx:
            await tx.execute(ADD, {**PINE, "name": f"one-{turn}", "number": 10})
            await tx.execute(ADD, [{"name": f"{n}-{turn}", "number": 10 + n} for n in (1, 2)])

    [names, *_] = await found(db, EVERY)
    assert len(names) == 2 + 3 * TIMES


async def test_a_missing_parameter_is_a_fault_each_time(db: Database) -> None:
    for _ in range(TIMES):
        async with db.read() as connection:
            with pytest.raises(StatementError):
                await connection.execute(THIS, {"that": "oak"})
            with pytest.raises(StatementError):
                await connection.execute(THIS)


async def test_a_refused_row_names_its_rule_each_time(db: Database) -> None:
    async def add_again() -> None:
        async with db.write() as tx:
            await tx.execute(ADD, OAK)

    for _ in range(TIMES):
        with pytest.raises(RowRefused) as refused:
            await add_again()
        assert refused.value.constraint == "crates_pkey"


async def test_an_error_does_not_show_the_refused_row(db: Database) -> None:
    for _ in range(TIMES):
        with pytest.raises(DBAPIError) as refused:
            async with db.write() as tx:
                await tx.execute(ADD, {**OAK, "name": "secret", "number": None})
        assert "secret" not in str(refused.value)


async def test_only_the_block_itself_sees_its_writes_before_the_commit(db: Database) -> None:
    for turn in range(TIMES):
        async with db.write() as tx:
            await tx.execute(ADD, {**PINE, "name": f"new-{turn}"})
            inside = (await tx.connection.execute(EVERY)).all()
            async with db.read() as connection:
                outside = (await connection.execute(EVERY)).all()
        assert len(inside) == len(outside) + 1


async def test_a_survey_sees_one_moment_each_time(db: Database) -> None:
    for turn in range(TIMES):
        async with db.survey() as connection:
            before = (await connection.execute(EVERY)).all()
            async with db.write() as tx:
                await tx.execute(ADD, {**PINE, "name": f"new-{turn}"})
            assert (await connection.execute(EVERY)).all() == before


@ON_POSTGRESQL
async def test_nothing_is_kept_when_an_error_was_passed_over(db: Database) -> None:
    broken = select(CRATES.c.number / bindparam("none"))

    async def go_on_regardless() -> None:
        async with db.write() as tx:
            await tx.execute(ADD, {**PINE, "name": "elm"})
            with pytest.raises(DBAPIError):
                await tx.connection.execute(broken, {"none": 0})

    for _ in range(TIMES):
        with pytest.raises(ServiceUnavailable):
            await go_on_regardless()

    assert await found(db, THIS, this="elm") == [[]] * TIMES


@ON_POSTGRESQL
async def test_a_connection_lost_within_a_block_is_an_error_and_is_replaced(db: Database) -> None:
    suicide = select(func.pg_terminate_backend(func.pg_backend_pid()))

    async def lose(block: Callable[[], Any]) -> None:
        async with block() as lent:
            await lent.execute(suicide)

    for _ in range(TIMES):
        for block in (db.read, db.write, db.survey):
            with pytest.raises(ServiceUnavailable):
                await lose(block)

    assert len((await found(db, EVERY))[0]) == 2


@ON_POSTGRESQL
async def test_a_cancelled_statement_leaves_nothing_behind(db: Database) -> None:
    sleeping = select(func.pg_sleep(60))

    async def linger() -> None:
        async with db.write() as tx:
            await tx.execute(ADD, {**PINE, "name": "elm"})
            await tx.execute(sleeping)

    # More than there are connections: each of them is lent again.
    for _ in range(12):
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(0.05):
                await linger()

    # Neither the crate nor a lock that keeps others from adding it.
    async with asyncio.timeout(60), db.write() as tx:
        await tx.execute(ADD, {**PINE, "name": "elm"})
    assert len((await found(db, EVERY))[0]) == 3


@ON_POSTGRESQL
async def test_a_changed_table_fails_at_most_one_cached_statement(db: Database) -> None:
    numbers = select(CRATES.c.number).order_by(CRATES.c.number)
    await found(db, numbers)
    async with db.write() as tx:
        await tx.execute(text("ALTER TABLE crates ALTER COLUMN number TYPE bigint"))

    async with db.read() as connection:
        with pytest.raises(DBAPIError):
            await connection.execute(numbers)
        assert list((await connection.execute(numbers)).scalars()) == [1, 2]


@ON_POSTGRESQL
async def test_a_connection_left_in_a_transaction_is_not_used_again(db: Database) -> None:
    async with db.read() as connection:
        await connection.execute(text("BEGIN"))
    async with db.read() as connection:
        # What now() says is the moment at which the transaction began.
        moments = [(await connection.execute(text("SELECT now()"))).scalar_one() for _ in range(2)]

    assert moments[0] < moments[1]
