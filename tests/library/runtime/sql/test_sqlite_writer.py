"""Many blocks share one COMMIT; a block that fails is rolled back by itself."""

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path

import pytest
from sqlalchemy import Column, Integer, MetaData, Table, Text, select, text

from skyway.runtime.errors import RowRefused, ServiceUnavailable, UnsafeDatabase
from skyway.runtime.sql.database import Database

METADATA = MetaData()
DRONES = Table(
    "drones",
    METADATA,
    Column("id", Integer, primary_key=True),
    Column("name", Text, nullable=False, unique=True),
)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "service.db"


@pytest.fixture
async def db(path: Path) -> AsyncIterator[Database]:
    async with Database(f"sqlite:///{path}") as opened:
        async with opened.write() as tx:
            await tx.connection.run_sync(METADATA.create_all)
        yield opened


def commits(path: Path) -> int:
    """Commits in the write-ahead log: each ends with a frame that names the file's size."""
    log = path.with_name(path.name + "-wal").read_bytes()
    page_size = int.from_bytes(log[8:12], "big")
    frames = range(32, len(log), 24 + page_size)
    return sum(log[start + 4 : start + 8] != bytes(4) for start in frames)


async def names(db: Database) -> set[str]:
    async with db.read() as connection:
        return set((await connection.execute(select(DRONES.c.name))).scalars())


async def add(db: Database, name: str) -> None:
    async with db.write() as tx:
        await tx.execute(DRONES.insert(), {"name": name})


async def test_blocks_that_wait_together_share_one_commit(db: Database, path: Path) -> None:
    before = commits(path)

    await asyncio.gather(*(add(db, f"drone-{number}") for number in range(40)))

    assert commits(path) - before == 1


async def test_a_group_has_at_most_64_blocks(db: Database, path: Path) -> None:
    before = commits(path)

    await asyncio.gather(*(add(db, f"drone-{number}") for number in range(65)))

    assert commits(path) - before == 2


async def test_blocks_one_after_another_are_each_committed(db: Database, path: Path) -> None:
    before = commits(path)

    for number in range(3):
        await add(db, f"drone-{number}")

    assert commits(path) - before == 3


async def test_a_failing_block_rolls_back_alone(db: Database, path: Path) -> None:
    before = commits(path)

    async def fail() -> None:
        async with db.write() as tx:
            await tx.execute(DRONES.insert(), {"name": "lost"})
            raise LookupError

    outcomes = await asyncio.gather(
        add(db, "first"), fail(), add(db, "first"), add(db, "last"), return_exceptions=True
    )

    assert [type(outcome) for outcome in outcomes] == [
        type(None),
        LookupError,
        RowRefused,
        type(None),
    ]
    assert await names(db) == {"first", "last"}
    assert commits(path) - before == 1


async def test_a_block_is_answered_only_after_the_commit(db: Database, path: Path) -> None:
    before = commits(path)
    seen: list[int] = []

    async def write(name: str) -> None:
        await add(db, name)
        seen.append(commits(path) - before)

    await asyncio.gather(write("a"), write("b"), write("c"))

    assert seen == [1, 1, 1]


async def test_a_refused_block_fails_only_when_readers_see_why(db: Database) -> None:
    async def add_or_read() -> set[str]:
        try:
            await add(db, "drone-1")
        except RowRefused:
            return await names(db)
        return {"added"}

    seen = await asyncio.gather(*(add_or_read() for _ in range(5)))

    assert seen == [{"added"}, *[{"drone-1"}] * 4]


async def test_a_cancelled_block_harms_no_other_block(db: Database) -> None:
    started = asyncio.Event()

    async def linger() -> None:
        async with db.write() as tx:
            await tx.execute(DRONES.insert(), {"name": "lost"})
            started.set()
            await asyncio.Event().wait()

    first = asyncio.create_task(add(db, "first"))
    lingering = asyncio.create_task(linger())
    last = asyncio.create_task(add(db, "last"))
    await started.wait()
    lingering.cancel()
    outcomes = await asyncio.gather(first, lingering, last, return_exceptions=True)

    assert [type(outcome) for outcome in outcomes] == [
        type(None),
        asyncio.CancelledError,
        type(None),
    ]
    assert await names(db) == {"first", "last"}


async def test_a_block_cancelled_before_its_turn_blocks_no_other(db: Database) -> None:
    async with db.write() as tx:
        waiting = asyncio.create_task(add(db, "lost"))
        after = asyncio.create_task(add(db, "after"))
        await tx.execute(DRONES.insert(), {"name": "during"})
        waiting.cancel()
    await after

    assert await names(db) == {"during", "after"}


async def test_a_failing_commit_fails_every_block_of_it(db: Database) -> None:
    async with db.write() as tx:
        await tx.execute(
            text(
                "CREATE TABLE seats (drone INTEGER REFERENCES drones(id)"
                " DEFERRABLE INITIALLY DEFERRED)"
            )
        )

    async def break_commit() -> None:
        async with db.write() as tx:
            await tx.execute(text("INSERT INTO seats VALUES (404)"))

    outcomes = await asyncio.gather(
        add(db, "first"), break_commit(), add(db, "last"), return_exceptions=True
    )
    await add(db, "later")

    assert [type(outcome) for outcome in outcomes] == [ServiceUnavailable] * 3
    assert await names(db) == {"later"}


async def test_a_block_within_a_block_is_refused_instead_of_waiting_for_itself(
    db: Database,
) -> None:
    async with db.write():
        with pytest.raises(RuntimeError, match="wait for itself"):
            async with db.write():
                pass


async def test_closing_waits_for_the_blocks_that_have_begun(path: Path) -> None:
    db = Database(f"sqlite:///{path}")
    async with db:
        async with db.write() as tx:
            await tx.connection.run_sync(METADATA.create_all)
        adding = [asyncio.create_task(add(db, f"drone-{number}")) for number in range(5)]
        await asyncio.sleep(0)
    await asyncio.gather(*adding)

    async with db:
        assert len(await names(db)) == 5


@pytest.mark.parametrize(
    ("pragma", "value"), [("journal_mode", "wal"), ("synchronous", 2), ("foreign_keys", 1)]
)
async def test_every_commit_is_synced(db: Database, pragma: str, value: object) -> None:
    async with db.write() as tx:
        written = await tx.execute(text(f"PRAGMA {pragma}"))

        assert written.scalar() == value


async def test_a_database_that_cannot_be_durable_is_not_opened() -> None:
    with pytest.raises(UnsafeDatabase, match="journal_mode memory"):
        async with Database("sqlite:///:memory:"):
            pass
