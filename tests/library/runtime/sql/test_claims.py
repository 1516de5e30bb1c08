"""At most one claimant at a time holds a due row."""

import asyncio
from datetime import timedelta

import pytest
from sqlalchemy import Column, Integer, MetaData, Row, Table, true

from skyway.runtime.clock import ManualClock
from skyway.runtime.sql.claims import FREE, Claiming, claim, claim_columns
from skyway.runtime.sql.database import Database

METADATA = MetaData()
REQUESTS = Table(
    "requests",
    METADATA,
    Column("day", Integer, primary_key=True),
    Column("number", Integer, primary_key=True),
    *claim_columns(),
)

#: SQLite has one writer: nobody claims while another replica does.
ON_POSTGRESQL = pytest.mark.parametrize(
    "database_url", [pytest.param("postgresql", marks=pytest.mark.integration)], indirect=True
)


@pytest.fixture
async def db(database: Database) -> Database:
    async with database.write() as tx:
        await tx.connection.run_sync(METADATA.create_all)
        # The first to claim lies last in the table.
        await tx.execute(REQUESTS.insert(), [{"day": 1, "number": n} for n in range(5, -1, -1)])
    return database


async def claim_rows(
    db: Database, clock: ManualClock, *, claimant: str, limit: int = 10
) -> list[Row[tuple[int, ...]]]:
    return await claim(
        db,
        REQUESTS,
        where=true(),
        order_by=[REQUESTS.c.number],
        limit=limit,
        claimant=claimant,
        lease_s=10.0,
        clock=clock,
    )


async def test_rows_are_claimed_in_order(db: Database, clock: ManualClock) -> None:
    first = await claim_rows(db, clock, claimant="a", limit=2)
    second = await claim_rows(db, clock, claimant="b", limit=2)

    assert [row.number for row in first] == [0, 1]
    assert [row.number for row in second] == [2, 3]


async def test_a_claim_until_the_year_3000_does_not_count(db: Database, clock: ManualClock) -> None:
    async with db.write() as tx:
        await tx.execute(
            REQUESTS.update().values(claimed_by="ghost", claimed_until_ms=32_503_680_000_000)
        )

    assert len(await claim_rows(db, clock, claimant="a", limit=10)) == 6


async def test_replicas_never_hold_the_same_row(db: Database, clock: ManualClock) -> None:
    taken = await asyncio.gather(
        *(claim_rows(db, clock, claimant=f"replica-{number}", limit=1) for number in range(8))
    )

    numbers = [row.number for rows in taken for row in rows]
    assert len(numbers) == len(set(numbers))


@ON_POSTGRESQL
async def test_a_claim_passes_by_rows_that_another_replica_is_claiming(
    db: Database, clock: ManualClock
) -> None:
    claiming = Claiming.of(REQUESTS, where=true(), order_by=[REQUESTS.c.number])

    async with db.write() as tx:
        first = await claiming.run(tx, limit=2, claimant="a", lease_s=10.0, clock=clock)
        async with asyncio.timeout(60):
            second = await claim_rows(db, clock, claimant="b", limit=2)

    assert [row.number for row in first] == [0, 1]
    assert [row.number for row in second] == [2, 3]


async def test_a_held_row_is_not_given_to_its_own_holder_again(
    db: Database, clock: ManualClock
) -> None:
    await claim_rows(db, clock, claimant="a")

    assert await claim_rows(db, clock, claimant="a") == []


async def test_a_claim_runs_out(db: Database, clock: ManualClock) -> None:
    await claim_rows(db, clock, claimant="dead")

    clock.advance(timedelta(seconds=9.9))
    early = await claim_rows(db, clock, claimant="heir")
    clock.advance(timedelta(seconds=0.1))
    late = await claim_rows(db, clock, claimant="heir")

    assert early == []
    assert len(late) == 6


async def test_a_freed_row_can_be_claimed_immediately(db: Database, clock: ManualClock) -> None:
    await claim_rows(db, clock, claimant="a")
    async with db.write() as tx:
        await tx.execute(REQUESTS.update().where(REQUESTS.c.number == 3).values(FREE))

    assert [row.number for row in await claim_rows(db, clock, claimant="b")] == [3]
