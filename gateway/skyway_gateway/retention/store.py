"""All SQL that deletes what is old: deliveries with all their parts, audit entries, attempts."""

from collections.abc import Collection, Sequence
from datetime import datetime
from itertools import takewhile
from typing import Final

from sqlalchemy import (
    BigInteger,
    ColumnElement,
    Delete,
    and_,
    bindparam,
    delete,
    exists,
    func,
    select,
    text,
    true,
    update,
)

from skyway.ids import DeliveryId
from skyway.runtime.clock import FleetClock
from skyway.runtime.idempotency_store import KEPT_MS
from skyway.runtime.sql.claims import FREE, NOW_MS, Claiming, claim_values
from skyway.runtime.sql.database import Database, Tx
from skyway.runtime.sql.in_list import in_list
from skyway.units import moment_to_ms
from skyway_gateway.delivery_tables import (
    IS_OVER,
    IS_TEST,
    custody,
    deliveries,
    exchanges,
    missions,
    packages,
    proofs,
)
from skyway_gateway.tables import (
    audit,
    audit_head,
    events,
    idempotency,
    notifications,
    outbox,
    personal_data,
    pruned,
    quotes,
    sandbox_missions,
    tracking_links,
    webhook_attempts,
)

#: How long a claim holds, seconds of wall time: longer than composition may take to answer.
_LEASE_S: Final = 60.0

#: The deliveries of one step.
BATCH: Final = 200

#: Stored answers and quotes are kept for a day of wall time, and their sweeps may be late. So
#: nothing is left of a delivery's call or quote an hour after that day. Milliseconds of wall time.
_ENDED_BEFORE_MS: Final = KEPT_MS + 3_600_000
_SWEPT_BEFORE_MS: Final = KEPT_MS + 1_800_000

_OLD_MS: Final = bindparam("old_ms", type_=BigInteger)

_has_last_event = exists().where(
    events.c.delivery_id == deliveries.c.delivery_id,
    events.c.sequence == deliveries.c.last_sequence,
    events.c.recorded_wall_ms <= NOW_MS - _ENDED_BEFORE_MS,
)
_are_swept = and_(
    ~exists().where(idempotency.c.created_at_ms <= NOW_MS - _SWEPT_BEFORE_MS),
    ~exists().where(quotes.c.expires_wall_ms <= NOW_MS - _SWEPT_BEFORE_MS),
)
_waits_in_outbox = exists().where(
    outbox.c.channel.in_(("composition", "mqtt")), outbox.c.stream == deliveries.c.delivery_id
)
_has_pending = exists().where(
    events.c.delivery_id == deliveries.c.delivery_id,
    notifications.c.event_id == events.c.event_id,
    notifications.c.state == text("'PENDING'"),
)


def _claiming(which: ColumnElement[bool]) -> Claiming:
    """Marks such deliveries as leaving, and claims them; marked ones again after a kill."""
    return Claiming.of(
        deliveries,
        where=and_(
            text(IS_OVER),
            which,
            deliveries.c.updated_ms < _OLD_MS,
            # Composition still needed it at the last try.
            deliveries.c.next_try_wall_ms <= NOW_MS,
            _has_last_event,
            _are_swept,
            ~_waits_in_outbox,
            ~_has_pending,
        ),
        order_by=[deliveries.c.updated_ms, deliveries.c.delivery_id],
        also={"is_leaving": true()},
    )


#: Deliveries of all accounts, and of test accounts only.
OF_ALL: Final = _claiming(true())
OF_TEST_ACCOUNTS: Final = _claiming(and_(text(IS_TEST)))

_KEEP: Final = (
    update(deliveries)
    .where(in_list(deliveries.c.delivery_id, "delivery_ids"))
    .values(is_leaving=False, next_try_wall_ms=bindparam("again_wall_ms"), **FREE)
)

_LEAVING: Final = (
    select(deliveries.c.delivery_id)
    .where(
        in_list(deliveries.c.delivery_id, "delivery_ids"), deliveries.c.is_leaving, ~_has_pending
    )
    .order_by(deliveries.c.delivery_id)
    .with_for_update()
)

_of_deliveries = in_list(events.c.delivery_id, "delivery_ids")

#: The parts before the whole.
_PARTS: Final = (
    events,
    custody,
    packages,
    missions,
    exchanges,
    tracking_links,
    personal_data,
    proofs,
    sandbox_missions,
    deliveries,
)
_DELETE: Final[Sequence[Delete]] = (
    delete(notifications).where(
        notifications.c.event_id.in_(select(events.c.event_id).where(_of_deliveries))
    ),
    *(delete(table).where(in_list(table.c.delivery_id, "delivery_ids")) for table in _PARTS),
)


async def claim_old(
    db: Database, which: Claiming, *, before: datetime, claimant: str, clock: FleetClock
) -> list[DeliveryId]:
    """Claim deliveries that ended before this moment of fleet time, and mark them as leaving."""
    values = claim_values(limit=BATCH, claimant=claimant, lease_s=_LEASE_S, clock=clock)
    old = values | {"old_ms": moment_to_ms(before)}
    claimed = which.in_order(await db.write_alone(which.statement, old))
    return [row.delivery_id for row in claimed]


async def keep(tx: Tx, delivery_ids: Collection[DeliveryId], *, until: datetime) -> None:
    """Free deliveries that leave later; they are not looked at before `until`, wall time."""
    asked = {"delivery_ids": sorted(delivery_ids), "again_wall_ms": moment_to_ms(until)}
    await tx.execute(_KEEP, asked)


async def delete_leaving(tx: Tx, delivery_ids: Collection[DeliveryId]) -> int:
    """Delete those that are leaving, with all that belongs to them; how many there were.

    A delivery whose events the customer has asked for again waits until they have arrived.
    """
    asked = {"delivery_ids": sorted(delivery_ids)}
    leaving = (await tx.execute(_LEAVING, asked)).scalars().all()
    if leaving:
        for statement in _DELETE:
            await tx.execute(statement, {"delivery_ids": leaving})
    return len(leaving)


#: The rows that one transaction deletes at most.
_LOG_ROWS: Final = 1000

_LOCK_HEAD: Final = select(audit_head.c.pruned_entries).with_for_update()
_OLDEST_ENTRIES: Final = (
    select(audit.c.number, audit.c.hash, audit.c.at_wall_ms)
    .order_by(audit.c.number)
    .limit(_LOG_ROWS)
)
_DELETE_ENTRIES: Final = delete(audit).where(audit.c.number <= bindparam("last"))

_OLDEST_ATTEMPTS: Final = (
    select(webhook_attempts.c.attempt_id, webhook_attempts.c.at_wall_ms)
    .order_by(webhook_attempts.c.attempt_id)
    .limit(_LOG_ROWS)
)
_DELETE_ATTEMPTS: Final = delete(webhook_attempts).where(
    in_list(webhook_attempts.c.attempt_id, "attempt_ids")
)


async def delete_entries(tx: Tx, *, before: datetime) -> bool:
    """Delete the oldest audit entries from before this wall time; whether there may be more.

    The head remembers how many were deleted and the hash of the last, where the chain now begins.
    """
    # New entries and other replicas wait here.
    await tx.execute(_LOCK_HEAD)
    before_ms = moment_to_ms(before)
    rows = (await tx.execute(_OLDEST_ENTRIES)).all()
    old = list(takewhile(lambda row: row.at_wall_ms < before_ms, rows))
    if old:
        last = old[-1]
        await tx.execute(_DELETE_ENTRIES, {"last": last.number})
        begin = {"pruned_entries": last.number, "pruned_hash": last.hash}
        await tx.execute(update(audit_head).values(begin))
    return len(old) == _LOG_ROWS


async def delete_attempts(tx: Tx, *, before: datetime) -> bool:
    """Delete the oldest attempts from before this wall time; whether there may be more.

    Ids of attempts sort by their time. Verification does not look for attempts of that age.
    """
    before_ms = moment_to_ms(before)
    rows = (await tx.execute(_OLDEST_ATTEMPTS)).all()
    old = [row.attempt_id for row in takewhile(lambda row: row.at_wall_ms < before_ms, rows)]
    if old:
        await tx.execute(_DELETE_ATTEMPTS, {"attempt_ids": old})
        await _mark(tx, webhook_attempts.name, before_ms)
    return len(old) == _LOG_ROWS


async def _mark(tx: Tx, table_name: str, before_ms: int) -> None:
    added = tx.insert(pruned).values(table_name=table_name, before_wall_ms=before_ms)
    latest = func.max if tx.dialect == "sqlite" else func.greatest
    await tx.execute(
        added.on_conflict_do_update(
            index_elements=["table_name"],
            set_={"before_wall_ms": latest(pruned.c.before_wall_ms, added.excluded.before_wall_ms)},
        )
    )
