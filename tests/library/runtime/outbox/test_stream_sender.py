"""How many statements a sender runs, and what the table holds while a row waits."""

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from contextlib import asynccontextmanager
from datetime import timedelta
from types import SimpleNamespace
from typing import Any

import pytest
from sqlalchemy import Executable, MetaData, Row, Table, select

from skyway.json_model import JsonModel
from skyway.runtime.clock import ManualClock
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.outbox.outbox_store import outbox_table
from skyway.runtime.outbox.stream_sender import Retry, StreamSender, quick_pace, retry_later
from skyway.runtime.sql.database import Database, Tx
from skyway.units import ms_to_moment
from tests.library.runtime.outbox.changes import Changes

METADATA = MetaData()
OUTBOX = outbox_table(METADATA)
CHANNEL = "gateway"

#: A SQLite file has one process: there are no replicas on it, and its statements share a COMMIT.
ON_POSTGRESQL = pytest.mark.parametrize(
    "database_url", [pytest.param("postgresql", marks=pytest.mark.integration)], indirect=True
)


class Note(JsonModel):
    text: str


class CountingDatabase(Database):
    """Counts writes: blocks, and statements that are alone."""

    def __init__(self, url: str, *, outbox: Table) -> None:
        super().__init__(url, outbox=outbox)
        self.blocks = self.alone = 0
        self.changes = Changes()

    @asynccontextmanager
    async def write(self) -> AsyncIterator[Tx]:
        self.blocks += 1
        self.changes.notify()
        async with super().write() as tx:
            yield tx

    async def write_alone(
        self, statement: Executable, parameters: Mapping[str, Any] | Sequence[Mapping[str, Any]]
    ) -> Sequence[Row[*tuple[Any, ...]]]:
        self.alone += 1
        self.changes.notify()
        return await super().write_alone(statement, parameters)


class Receiver:
    """Notes the rows that it receives, and asks for each again after the next given time."""

    def __init__(self, *again_after_s: float) -> None:
        self.again_after_s = list(again_after_s)
        self.taken: list[tuple[str, int]] = []  # addresses, and how often each was tried before

    async def receive(self, row: Row[Any]) -> Retry | None:
        self.taken.append((row.address, row.attempts))
        if not self.again_after_s:
            return None
        return Retry(after_s=self.again_after_s.pop(0), attempts=row.attempts + 1)


class BrokenOnce(Receiver):
    """Fails with a bug the first time."""

    async def receive(self, row: Row[Any]) -> Retry | None:
        await super().receive(row)
        if len(self.taken) == 1:
            raise LookupError("a bug")
        return None


@pytest.fixture
async def db(database_url: str) -> AsyncIterator[CountingDatabase]:
    async with CountingDatabase(database_url, outbox=OUTBOX) as opened:
        async with opened.write() as tx:
            await tx.connection.run_sync(METADATA.create_all)
        yield opened


@contextlib.asynccontextmanager
async def sending(db: Database, receiver: Receiver, clock: ManualClock) -> AsyncIterator[None]:
    sender = StreamSender(db, CHANNEL, receiver.receive, clock=clock, pace=quick_pace())
    task = asyncio.create_task(sender.run())
    try:
        yield
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


async def write(db: Database, *addresses: str, stream: str = "s") -> None:
    async with db.write() as tx:
        for address in addresses:
            tx.report(CHANNEL, address, Note(text=address), stream=stream)


async def rows(db: Database) -> Sequence[Row[Any]]:
    async with db.read() as connection:
        return (await connection.execute(select(OUTBOX).order_by(OUTBOX.c.id))).all()


async def oldest(db: Database) -> Row[Any]:
    return (await rows(db))[0]


async def until_empty(db: Database) -> None:
    async with asyncio.timeout(60):
        while await rows(db):
            pass


async def until_taken(db: Database, times: int, *, by: Receiver) -> Row[Any]:
    """Wait until a row was taken so often, without time going by; the row then.

    Were the clock moved meanwhile, the claim under which it is taken could be almost over.
    """
    async with asyncio.timeout(60):
        while len(by.taken) < times:
            await rows(db)
    return await oldest(db)


async def until_looked_again(db: CountingDatabase) -> None:
    """Wait until the sender has rested and turned to the table again, without time going by."""
    looks = db.blocks + db.alone
    await db.changes.until(lambda: db.blocks + db.alone >= looks + 2)


async def test_a_sender_that_ends_deletes_what_it_has_sent(
    db: CountingDatabase, clock: ManualClock
) -> None:
    receiver = Receiver()
    await write(db, "/1")

    async with sending(db, receiver, clock):
        async with asyncio.timeout(60):
            while not receiver.taken:
                await rows(db)

    assert await rows(db) == []


async def test_a_sender_leaves_the_rows_of_other_processes_until_it_polls(
    db: CountingDatabase, clock: ManualClock, database_url: str
) -> None:
    receiver, polls = Receiver(), [False, False, False, True]
    sender = StreamSender(
        db,
        CHANNEL,
        receiver.receive,
        clock=clock,
        pace=quick_pace(),
        polls=lambda: not polls or polls.pop(0),
    )

    async def pass_time(is_so: Callable[[], bool]) -> None:
        async with asyncio.timeout(60):
            while not is_so():
                clock.advance(timedelta(seconds=1))
                await rows(db)

    async with Database(database_url, outbox=OUTBOX) as other:
        sending = asyncio.create_task(sender.run())
        await pass_time(lambda: len(polls) < 4)
        await write(other, "/1")
        await pass_time(lambda: bool(receiver.taken))
        sending.cancel()
        await asyncio.gather(sending, return_exceptions=True)

    assert polls == []


@ON_POSTGRESQL
async def test_on_postgresql_a_look_at_the_table_is_one_statement(
    db: CountingDatabase, clock: ManualClock
) -> None:
    receiver, addresses = Receiver(), [f"/{number}" for number in range(10)]
    await write(db, *addresses)
    blocks = db.blocks

    async with sending(db, receiver, clock):
        await until_empty(db)

    assert receiver.taken == [(address, 0) for address in addresses]
    assert db.blocks == blocks
    # The first claims a row, the last deletes one, and those in between do both.
    assert db.alone == len(addresses) + 1


async def test_a_retry_within_a_claim_is_not_written_before_the_row_is_due(
    db: CountingDatabase, clock: ManualClock
) -> None:
    # Both waits end within the claim: a longer wait is written to the table immediately.
    receiver = Receiver(2.0, 2.0)
    await write(db, "/a")

    async with sending(db, receiver, clock):
        await until_taken(db, 1, by=receiver)
        await until_looked_again(db)
        once = await oldest(db)
        clock.advance(timedelta(seconds=2.5))
        twice = await until_taken(db, 2, by=receiver)

    assert (once.attempts, once.due_at_ms) == (0, 0)
    assert once.claimed_by is not None
    assert twice.attempts == 1
    assert receiver.taken == [("/a", 0), ("/a", 1)]


@pytest.mark.parametrize("wait_s", [14.2, 100.0])
async def test_a_row_that_waits_until_its_claim_is_almost_over_is_freed(
    db: CountingDatabase, clock: ManualClock, wait_s: float
) -> None:
    receiver = Receiver(wait_s)
    await write(db, "/a")

    async with sending(db, receiver, clock):
        row = await until_taken(db, 1, by=receiver)
        async with asyncio.timeout(60):
            while row.claimed_by is not None:
                row = await oldest(db)

    assert ms_to_moment(row.due_at_ms) - clock.wall_now() >= timedelta(seconds=wait_s)


async def test_a_row_whose_sending_breaks_is_sent_again_when_its_claim_runs_out(
    db: CountingDatabase, clock: ManualClock
) -> None:
    receiver = BrokenOnce()
    await write(db, "/a")

    async with sending(db, receiver, clock):
        await until_taken(db, 1, by=receiver)
        await until_looked_again(db)
        left = await rows(db)
        clock.advance(timedelta(seconds=15))
        await until_empty(db)

    assert [row.address for row in left] == ["/a"]
    assert receiver.taken == [("/a", 0), ("/a", 0)]


@ON_POSTGRESQL
async def test_a_row_that_one_sender_holds_is_not_sent_by_another(
    db: CountingDatabase, clock: ManualClock
) -> None:
    receiver, other = Receiver(5.0), Receiver()
    await write(db, "/a")

    async with sending(db, receiver, clock):
        await until_taken(db, 1, by=receiver)
        async with sending(db, other, clock):
            for _ in range(8):
                await rows(db)
                clock.advance(timedelta(seconds=0.5))

    assert other.taken == []


class AwayOnce(CountingDatabase):
    """Is away at the first look after a row was sent; the send of another row ends meanwhile."""

    def __init__(self, url: str) -> None:
        super().__init__(url, outbox=OUTBOX)
        self.is_away = False
        self.meanwhile, self.was_away = asyncio.Event(), asyncio.Event()

    async def _answer(self) -> None:
        if self.is_away:
            self.is_away = False
            self.meanwhile.set()
            for _ in range(10):
                await asyncio.sleep(0)
            self.was_away.set()
            raise ServiceUnavailable("database", "it is away")

    @asynccontextmanager
    async def write(self) -> AsyncIterator[Tx]:
        await self._answer()
        async with super().write() as tx:
            yield tx

    async def write_alone(
        self, statement: Executable, parameters: Mapping[str, Any] | Sequence[Mapping[str, Any]]
    ) -> Sequence[Row[*tuple[Any, ...]]]:
        await self._answer()
        return await super().write_alone(statement, parameters)


async def test_rows_that_were_sent_before_and_during_a_failed_look_are_deleted(
    database_url: str, clock: ManualClock
) -> None:
    taken: list[str] = []

    async with AwayOnce(database_url) as db:

        async def receive(row: Row[Any]) -> None:
            taken.append(row.address)
            if row.address == "/2":
                db.is_away = True
                await db.meanwhile.wait()

        async with db.write() as tx:
            await tx.connection.run_sync(METADATA.create_all)
        await write(db, "/1", stream="s")
        await write(db, "/2", stream="t")
        sender = StreamSender(db, CHANNEL, receive, clock=clock, pace=quick_pace())
        task = asyncio.create_task(sender.run())
        async with asyncio.timeout(60):
            await db.was_away.wait()
        await write(db, "/3", stream="u")
        async with asyncio.timeout(60):
            while "/3" not in taken:
                await rows(db)
        left = {row.address for row in await rows(db)}
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    assert left <= {"/3"}
    assert taken == ["/1", "/2", "/3"]


def test_the_pause_of_a_row_that_is_tried_for_weeks_stays_the_longest_one() -> None:
    row: Any = SimpleNamespace(attempts=100_000)

    assert retry_later(row, (0.2, 30.0)) == Retry(after_s=30.0, attempts=100_001)
