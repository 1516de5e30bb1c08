"""The same Idempotency-Key, the same effect and the same answer."""

import asyncio
from datetime import timedelta

import pytest
from sqlalchemy import Column, Integer, MetaData, Table, Text, func, select, text

from skyway.errors import InvalidInput
from skyway.runtime.clock import FleetClock, ManualClock
from skyway.runtime.errors import Conflict, IdempotencyKeyReused
from skyway.runtime.idempotency_store import (
    Act,
    Answer,
    KeyedCall,
    idempotency_table,
    once,
    sweep,
)
from skyway.runtime.sql.database import Database, Tx

METADATA = MetaData()
idempotency_table(METADATA)
KEYS = Table(
    "keys",
    METADATA,
    Column("id", Integer, primary_key=True),
    Column("name", Text, nullable=False),
)
SECRET = b"sk-the-customers-only-key"


@pytest.fixture
async def db(database: Database) -> Database:
    async with database.write() as tx:
        await tx.connection.run_sync(METADATA.create_all)
    return database


def making(name: str, *, status: int = 201) -> Act:
    """An act that makes a key, and shows a secret once."""

    async def act(tx: Tx) -> Answer:
        await tx.execute(KEYS.insert(), {"name": name})
        return Answer(status, SECRET + name.encode(), {"location": f"/v1/keys/{name}"})

    return act


async def post(
    db: Database,
    clock: FleetClock,
    act: Act,
    *,
    key: str | None = "key-1",
    caller: str = "customer:c1",
    route: str = "POST /v1/keys",
    body: bytes = b"{}",
) -> Answer:
    return await once(db, KeyedCall(caller, route, key, body), act=act, clock=clock)


async def made(db: Database) -> int:
    async with db.read() as connection:
        counted = await connection.execute(select(func.count()).select_from(KEYS))
        return int(counted.scalar_one())


async def test_the_same_key_gets_the_same_answer_and_acts_once(
    db: Database, clock: FleetClock
) -> None:
    first = await post(db, clock, making("a"))
    second = await post(db, clock, making("b"))

    assert second == first
    assert (first.is_replayed, second.is_replayed) == (False, True)
    assert await made(db) == 1


async def test_the_same_key_with_another_body_is_refused(db: Database, clock: FleetClock) -> None:
    await post(db, clock, making("a"), body=b"{}")

    with pytest.raises(IdempotencyKeyReused):
        await post(db, clock, making("b"), body=b"[]")

    assert await made(db) == 1


@pytest.mark.parametrize("scope", [{"caller": "customer:c2"}, {"route": "POST /v1/deliveries"}])
async def test_a_key_counts_for_its_caller_and_route_only(
    db: Database, clock: FleetClock, scope: dict[str, str]
) -> None:
    await post(db, clock, making("a"))

    other = await post(db, clock, making("b"), body=b"other", **scope)

    assert not other.is_replayed
    assert await made(db) == 2


async def test_without_a_key_every_call_acts(db: Database, clock: FleetClock) -> None:
    await post(db, clock, making("a"), key=None)
    await post(db, clock, making("a"), key=None)

    assert await made(db) == 2


async def test_a_server_error_is_undone_and_never_replayed(db: Database, clock: FleetClock) -> None:
    failed = await post(db, clock, making("a", status=503))
    undone = await made(db)
    second = await post(db, clock, making("b"))

    assert (failed.status, undone) == (503, 0)
    assert (second.status, second.is_replayed) == (201, False)


async def test_an_act_that_raises_leaves_its_key_free(db: Database, clock: FleetClock) -> None:
    async def refuse(_tx: Tx) -> Answer:
        raise Conflict("TOO_LATE", "it has left")

    with pytest.raises(Conflict):
        await post(db, clock, refuse)
    second = await post(db, clock, making("b"))

    assert not second.is_replayed


async def test_the_same_key_at_the_same_time_acts_once(db: Database, clock: FleetClock) -> None:
    answers = await asyncio.gather(*(post(db, clock, making(f"a{n}")) for n in range(8)))

    assert {answer.body for answer in answers} == {answers[0].body}
    assert sum(not answer.is_replayed for answer in answers) == 1
    assert await made(db) == 1


async def test_a_repeated_call_that_cannot_act_twice_gets_the_first_answer(
    db: Database, clock: FleetClock
) -> None:
    """Whether it fails before the answer, with the answer or at the end of the block."""
    key = {"id": 1, "name": "a"}

    async def at_once(tx: Tx) -> Answer:
        await tx.execute(KEYS.insert(), key)
        return Answer(201, b"made")

    async def at_the_end(tx: Tx) -> Answer:
        tx.add(KEYS, [key])
        return Answer(201, b"made")

    first = await post(db, clock, at_once)
    for act in (at_once, at_the_end, making("b", status=503)):
        again = await post(db, clock, act)
        assert (again, again.is_replayed) == (first, True)
    with pytest.raises(IdempotencyKeyReused):
        await post(db, clock, at_once, body=b"[]")

    assert await made(db) == 1


async def test_a_key_is_free_again_after_a_day(db: Database, clock: ManualClock) -> None:
    await post(db, clock, making("a"))

    clock.advance(timedelta(hours=23, minutes=59))
    kept = await post(db, clock, making("b"))
    clock.advance(timedelta(minutes=1))
    free = await post(db, clock, making("c"), body=b"other")

    assert (kept.is_replayed, free.is_replayed) == (True, False)


async def test_old_keys_are_swept(db: Database, clock: ManualClock) -> None:
    await post(db, clock, making("a"), key="old")
    clock.advance(timedelta(hours=24))
    await post(db, clock, making("b"), key="new")

    swept = await sweep(db, clock)

    assert swept == 1
    assert (await post(db, clock, making("c"), key="new")).is_replayed


async def test_neither_answer_nor_key_can_be_read_at_rest(db: Database, clock: FleetClock) -> None:
    await post(db, clock, making("a"), key="the-key-itself", body=b"the-body-itself")

    async with db.read() as connection:
        rows = (await connection.execute(text("SELECT * FROM idempotency"))).all()
    stored = b" ".join(
        column if isinstance(column, bytes) else str(column).encode() for column in rows[0]
    )
    assert len(rows) == 1
    for secret in (SECRET, b"the-key-itself", b"the-body-itself", b"/v1/keys/a", b"customer:c1"):
        assert secret not in stored


@pytest.mark.parametrize("key", ["", "k" * 256])
async def test_a_key_has_1_to_255_characters(db: Database, clock: FleetClock, key: str) -> None:
    with pytest.raises(InvalidInput, match="255"):
        await post(db, clock, making("a"), key=key)
