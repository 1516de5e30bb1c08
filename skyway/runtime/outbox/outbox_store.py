"""The table of messages that wait to be sent, all its SQL, and its gauges.

A sender makes its statements once: making one takes as long as running it.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from sqlalchemy import (
    BigInteger,
    Boolean,
    Column,
    ColumnElement,
    Delete,
    Index,
    Integer,
    LargeBinary,
    MetaData,
    Table,
    Text,
    Update,
    and_,
    bindparam,
    exists,
    func,
    select,
)
from sqlalchemy.sql.dml import ReturningUpdate

from skyway.runtime.metrics import Gauge
from skyway.runtime.sql.claims import FREE, NOW_MS, Claiming, claim_columns
from skyway.runtime.sql.database import Database, Tx
from skyway.runtime.sql.in_list import in_list


def outbox_table(metadata: MetaData) -> Table:
    """The table of messages to send; `channel` is ``mqtt`` or the name of a service."""
    return Table(
        "outbox",
        metadata,
        # An id is never reused, so a late answer cannot delete another row.
        Column("id", BigInteger().with_variant(Integer, "sqlite"), primary_key=True),
        Column("channel", Text, nullable=False),
        Column("stream", Text, nullable=False),
        Column("address", Text, nullable=False),
        Column("payload", LargeBinary, nullable=False),
        Column("confirmed_by", Text, nullable=False),
        Column("message_id", Text),
        Column("mqtt_qos", Integer, nullable=False),
        Column("is_retained", Boolean, nullable=False),
        Column("traceparent", Text),
        Column("attempts", Integer, nullable=False, server_default="0"),
        Column("due_at_ms", BigInteger, nullable=False, server_default="0"),
        # When the message was stored, by the machine's clock.
        Column("stored_wall_ms", BigInteger, nullable=False, server_default="0"),
        *claim_columns(),
        Index("outbox_stream", "channel", "stream", "id"),
        Index("outbox_message", "message_id"),
        sqlite_autoincrement=True,
    )


async def confirm(tx: Tx, message_ids: Sequence[str]) -> int:
    """Delete messages that their receiver has confirmed; returns how many were in the outbox."""
    if not message_ids:
        return 0
    # A message of this transaction is not in the table yet.
    tx.withdraw(message_ids)
    deleted = await tx.execute(_delete_confirmed(tx.outbox_table()), {"message_ids": message_ids})
    return deleted.rowcount


@lru_cache(maxsize=10)  # a service has one outbox
def _delete_confirmed(outbox: Table) -> Delete:
    return outbox.delete().where(in_list(outbox.c.message_id, "message_ids"))


def claim_due(table: Table, channel: str) -> Claiming:
    """Claim due rows of a channel that are the oldest of their stream, without the `sent` rows.

    The column `has_next` says whether another row of the stream waits behind the row.
    """
    is_due = and_(_is_oldest(table, channel), table.c.due_at_ms <= NOW_MS)
    newer = table.alias("newer")
    has_next = exists().where(
        newer.c.channel == table.c.channel,
        newer.c.stream == table.c.stream,
        newer.c.id > table.c.id,
    )
    return Claiming.of(
        table, where=is_due, order_by=[table.c.id], answers=[has_next.label("has_next")]
    )


def delete_sent(table: Table) -> Delete:
    """Delete the `sent` rows."""
    return table.delete().where(in_list(table.c.id, "sent"))


def delete_and_claim(
    delete: Delete, claim: ReturningUpdate[*tuple[Any, ...]]
) -> ReturningUpdate[*tuple[Any, ...]]:
    """Both in one statement, for PostgreSQL. Each sees the table as it was before."""
    return claim.add_cte(delete.cte("deleted"))


def free_row(table: Table) -> Update:
    """Free the row `sent_id`, unless somebody else has locked it.

    A locked row is being confirmed. A transaction that confirms several rows holds one lock while
    it waits for the next. Waiting here for that lock, with the next row locked, would be a
    deadlock. If the row is not deleted, it becomes free when its claim runs out.
    """
    row, this = table.alias("row_sent"), bindparam("sent_id", type_=table.c.id.type)
    unlocked = select(row.c.id).where(row.c.id == this).with_for_update(skip_locked=True)
    return table.update().where(table.c.id == this, table.c.id.in_(unlocked)).values(FREE)


def _is_oldest(table: Table, channel: str) -> ColumnElement[bool]:
    """Whether a row is the oldest of its stream on this channel, without the `sent` rows."""
    columns, older = table.c, table.alias("older")
    has_older = exists().where(
        older.c.channel == columns.channel,
        older.c.stream == columns.stream,
        older.c.id < columns.id,
        ~in_list(older.c.id, "sent"),
    )
    return and_(columns.channel == channel, ~in_list(columns.id, "sent"), ~has_older)


@dataclass(frozen=True, slots=True)
class OutboxGauges:
    """Reads the outbox of a database; the `channels` are shown even if nothing waits on them."""

    db: Database
    table: Table
    channels: tuple[str, ...]

    async def read(self) -> list[Gauge]:
        """How many messages wait on each channel, and the age of the oldest."""
        columns = self.table.c
        query = select(columns.channel, func.count(), func.min(columns.stored_wall_ms))
        async with self.db.survey() as connection:
            rows = await connection.execute(query.group_by(columns.channel))
        found = {channel: (waiting, stored_ms / 1000) for channel, waiting, stored_ms in rows}
        readings, now_s = [], time.time()
        for channel in self.channels:
            labels, (messages, stored_s) = {"channel": channel}, found.get(channel, (0, now_s))
            age_s = max(now_s - stored_s, 0.0)
            about = "messages that are not sent, or not confirmed yet"
            readings += [
                Gauge("skyway_outbox_depth", about, messages, labels),
                Gauge("skyway_outbox_age_seconds", "age of the oldest of them", age_s, labels),
            ]
        return readings
