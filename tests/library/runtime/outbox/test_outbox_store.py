"""The depth and the age of an outbox, and how long messages wait before they are sent."""

from sqlalchemy import update

from skyway.runtime.clock import ManualClock
from skyway.runtime.metrics import DURATIONS
from skyway.runtime.outbox.outbox_store import OutboxGauges
from skyway.runtime.sql.database import Database
from tests.library.runtime.outbox.test_senders import (
    OUTBOX,
    InMemoryService,
    report,
    sending,
    until_sent,
)
from tests.library.runtime.outbox.test_senders import db as db  # noqa: PLC0414 - a fixture

GAUGES = ("skyway_outbox_depth", "skyway_outbox_age_seconds")


async def shown(db: Database) -> dict[tuple[str, str], float]:
    readings = await OutboxGauges(db, OUTBOX, ("gateway", "mqtt")).read()
    return {(each.name, each.labels["channel"]): each.value for each in readings}


async def test_an_empty_outbox_has_no_depth_and_no_age(db: Database) -> None:
    assert await shown(db) == {(name, of): 0.0 for name in GAUGES for of in ("gateway", "mqtt")}


async def test_the_age_is_that_of_the_oldest_message_of_a_channel(db: Database) -> None:
    await report(db, "a", "b", "c")
    async with db.write() as tx:
        older = OUTBOX.c.stored_wall_ms - 60_000
        await tx.execute(update(OUTBOX).where(OUTBOX.c.stream == "b").values(stored_wall_ms=older))

    found = await shown(db)

    assert found["skyway_outbox_depth", "gateway"] == 3
    assert found["skyway_outbox_age_seconds", "gateway"] >= 60.0
    assert found["skyway_outbox_depth", "mqtt"] == 0


async def test_each_message_is_timed_once_until_it_is_sent(
    db: Database, clock: ManualClock
) -> None:
    before = DURATIONS.count_of("skyway_outbox_delay_seconds", channel="gateway")
    await report(db, "a", "b", "c")

    async with sending(db, InMemoryService(), clock):
        await until_sent(db, clock)

    after = DURATIONS.count_of("skyway_outbox_delay_seconds", channel="gateway")
    assert after == before + 3
