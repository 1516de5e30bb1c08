"""All SQL that deletes the oldest entries of the audit log and the oldest attempts of webhooks."""

from datetime import datetime
from itertools import takewhile
from typing import Final

from sqlalchemy import bindparam, delete, func, select, update

from skyway.runtime.sql.database import Tx
from skyway.runtime.sql.in_list import in_list
from skyway.units import moment_to_ms
from skyway_gateway.tables import audit, audit_head, pruned, webhook_attempts

#: The rows that one transaction deletes at most.
_BATCH: Final = 1000

_LOCK_HEAD: Final = select(audit_head.c.pruned_entries).with_for_update()
_OLDEST_ENTRIES: Final = (
    select(audit.c.number, audit.c.hash, audit.c.at_wall_ms).order_by(audit.c.number).limit(_BATCH)
)
_DELETE_ENTRIES: Final = delete(audit).where(audit.c.number <= bindparam("last"))

_OLDEST_ATTEMPTS: Final = (
    select(webhook_attempts.c.attempt_id, webhook_attempts.c.at_wall_ms)
    .order_by(webhook_attempts.c.attempt_id)
    .limit(_BATCH)
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
    return len(old) == _BATCH


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
    return len(old) == _BATCH


async def _mark(tx: Tx, table_name: str, before_ms: int) -> None:
    added = tx.insert(pruned).values(table_name=table_name, before_wall_ms=before_ms)
    latest = func.max if tx.dialect == "sqlite" else func.greatest
    await tx.execute(
        added.on_conflict_do_update(
            index_elements=["table_name"],
            set_={"before_wall_ms": latest(pruned.c.before_wall_ms, added.excluded.before_wall_ms)},
        )
    )
