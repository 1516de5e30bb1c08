"""Replicas on one PostgreSQL: the first one leads, and a dead one is replaced. Rests on SQLite."""

import asyncio
from collections.abc import Callable
from contextlib import AsyncExitStack
from datetime import timedelta

import pytest
from sqlalchemy import MetaData, exists, select

from skyway.runtime.clock import ManualClock
from skyway.runtime.loops import Loops
from skyway.runtime.replicas.membership import LeaderStep, Membership, PollsInTurn
from skyway.runtime.replicas.replica_store import DEAD_AFTER_MS, ReplicaStore, replicas_table
from skyway.runtime.sql.database import Database, Rest

METADATA = MetaData()
REPLICAS = replicas_table(METADATA)
DRONES = [f"drn_{number}" for number in range(50)]

A_ROW = {"replica_id": "a", "joined_wall_ms": 0, "seen_wall_ms": 0, "is_listening": True}

on_postgresql = pytest.mark.parametrize(
    "database_url", [pytest.param("postgresql", marks=pytest.mark.integration)], indirect=True
)

on_sqlite = pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)

Join = Callable[[str], Membership]


@pytest.fixture
async def db(database: Database) -> Database:
    async with database.write() as tx:
        await tx.connection.run_sync(METADATA.create_all)
    return database


@pytest.fixture
def join(db: Database, clock: ManualClock) -> Join:
    def replica(own_id: str) -> Membership:
        made = Membership(ReplicaStore(db, REPLICAS), own_id=own_id, clock=clock)
        made.set_listening(True)
        return made

    return replica


async def pass_time(db: Database, *, by_ms: int) -> None:
    """Let time pass at the database by making all rows of the table older."""
    async with db.write() as tx:
        older = {
            each.name: each - by_ms for each in (REPLICAS.c.joined_wall_ms, REPLICAS.c.seen_wall_ms)
        }
        await tx.execute(REPLICAS.update().values(older))


async def beat(*replicas: Membership) -> None:
    for each in replicas:
        await each.step()


@on_postgresql
async def test_the_first_replica_leads_until_it_dies_and_comes_back_as_the_last(
    db: Database, join: Join
) -> None:
    first, second, third = join("c"), join("b"), join("a")
    for each in (first, second, third):
        await beat(each)
        await pass_time(db, by_ms=5)
    await beat(first, second, third)
    assert [each.leads for each in (first, second, third)] == [True, False, False]

    await pass_time(db, by_ms=DEAD_AFTER_MS + 100)
    await beat(second, third, second)
    assert [second.leads, third.leads] == [True, False]

    await beat(first, second, third)
    assert [each.leads for each in (first, second, third)] == [False, True, False]


@on_postgresql
async def test_drones_of_a_dead_replica_are_gained_and_were_not_owned_before(
    db: Database, join: Join, clock: ManualClock
) -> None:
    first, second = join("a"), join("b")
    await beat(first, second, first)
    began_at = clock.now()
    assert all(first.owns(each) != second.owns(each) for each in DRONES)
    own = [each for each in DRONES if second.owns(each)]
    clock.advance(timedelta(seconds=10))

    await pass_time(db, by_ms=DEAD_AFTER_MS + 100)
    await beat(second)

    assert await second.gained.wait(0.0)
    assert all(second.owns(each) for each in DRONES)
    assert [each for each in DRONES if second.has_owned(each, began_at)] == own
    assert all(second.has_owned(each, clock.now()) for each in DRONES)


@on_postgresql
async def test_a_drone_that_another_replica_had_meanwhile_was_not_owned_all_the_time(
    db: Database, join: Join, clock: ManualClock
) -> None:
    first, second = join("a"), join("b")
    await beat(first)
    began_at = clock.now()
    clock.advance(timedelta(seconds=10))
    await beat(second, first)
    lent = {each for each in DRONES if second.owns(each)}

    await pass_time(db, by_ms=DEAD_AFTER_MS + 100)
    clock.advance(timedelta(seconds=10))
    await beat(first)

    assert all(first.owns(each) for each in DRONES)
    assert {each for each in DRONES if not first.has_owned(each, began_at)} == lent


@on_postgresql
async def test_a_row_from_the_future_is_no_live_replica(db: Database, join: Join) -> None:
    damaged, sound = join("a"), join("b")
    await beat(damaged)
    await pass_time(db, by_ms=-86_400_000)

    await beat(sound)

    assert (sound.alive, sound.leads) == (1, True)


@on_postgresql
async def test_a_replica_that_leaves_or_loses_the_broker_is_replaced_at_the_next_beat(
    db: Database, join: Join
) -> None:
    first, second = join("a"), join("b")
    await beat(first, second, first)

    first.set_listening(False)
    await beat(first, second)
    assert [first.leads, second.leads] == [False, True]
    assert all(second.owns(each) for each in DRONES)

    async with AsyncExitStack() as stack:
        await stack.enter_async_context(first)
    await beat(second)
    assert second.leads


@on_postgresql
async def test_a_replica_that_starts_owns_only_its_share_before_its_first_beat(
    db: Database, join: Join
) -> None:
    await beat(join("a"))

    async with join("b") as starting:
        assert not starting.leads
        assert 0 < sum(map(starting.owns, DRONES)) < len(DRONES)


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
async def test_the_only_process_on_sqlite_leads_and_owns_everything(
    db: Database, join: Join
) -> None:
    async with join("a") as only, db.read() as connection:
        assert only.leads
        assert all(map(only.owns, DRONES))
        assert (await connection.execute(REPLICAS.select())).all() == []


@on_postgresql
async def test_a_replica_that_loses_the_lead_does_its_step_once_more(
    db: Database, join: Join
) -> None:
    done: list[str] = []

    async def step() -> bool:
        done.append("step")
        return False

    second = join("b")
    work = LeaderStep(second, step, begin=lambda: done.append("begin"))
    await work()
    await beat(second)
    await work()
    await work()
    await pass_time(db, by_ms=DEAD_AFTER_MS + 100)
    await beat(join("a"), second)
    await work()
    await work()

    assert done == ["begin", "step", "step", "step"]


@on_postgresql
async def test_replicas_that_poll_in_turn_poll_as_often_as_one(db: Database, join: Join) -> None:
    first, second = join("a"), join("b")
    alone, in_turn = PollsInTurn(join("c")), [PollsInTurn(first), PollsInTurn(second)]
    await beat(first, second, first)

    assert [alone() for _ in range(4)] == [True] * 4
    assert sum(polls() for _ in range(4) for polls in in_turn) == 4


async def rested(rest: Rest) -> bool:
    """Whether loops rest after two steps."""
    await rest.step()
    await rest.step()
    return rest.is_on


@on_sqlite
async def test_loops_rest_until_this_process_changes_a_row(db: Database) -> None:
    rest = Rest(db, [])
    assert await rested(rest)

    async with db.write() as tx:
        await tx.execute(REPLICAS.delete())
    assert rest.is_on

    async with db.write() as tx:
        await tx.execute(tx.insert(REPLICAS).values(A_ROW))
    assert not rest.is_on
    await rest.step()
    assert not rest.is_on
    await rest.step()
    assert rest.is_on


@on_sqlite
async def test_loops_do_not_rest_while_a_row_is_open(db: Database) -> None:
    rest = Rest(db, [exists(select(REPLICAS))])
    async with db.write() as tx:
        await tx.execute(tx.insert(REPLICAS).values(A_ROW))
    assert not await rested(rest)

    async with db.write() as tx:
        await tx.execute(REPLICAS.delete())

    assert await rested(rest)


@on_sqlite
async def test_loops_look_again_from_time_to_time_and_after_a_call(db: Database) -> None:
    rest = Rest(db, [])
    assert await rested(rest)

    steps = 0
    while rest.is_on:
        await rest.step()
        steps += 1
    assert steps == 30
    await rest.step()
    assert rest.is_on

    rest.end()
    assert not rest.is_on
    assert await rested(rest)


@on_postgresql
async def test_with_a_database_server_loops_never_rest(join: Join) -> None:
    replica = join("rpl_a")
    async with replica, Loops() as loops:
        replica.start(loops)
        running = {task.get_name() for task in asyncio.all_tasks()}

    assert "rest" not in running
    assert replica.looks()
