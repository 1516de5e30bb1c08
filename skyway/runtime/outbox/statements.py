"""The statements by which rows of the outbox are taken, done with and freed.

They are made once for a sender: to make one takes as long as to run it.
"""

from typing import Any

from sqlalchemy import ColumnElement, Delete, Table, Update, and_, bindparam, exists, select
from sqlalchemy.sql.dml import ReturningUpdate

from skyway.runtime.sql.among import among
from skyway.runtime.sql.claims import FREE, NOW_MS, Claiming


def claiming(table: Table, channel: str) -> Claiming:
    """How rows that are due and next on this channel are claimed, those `done` with left out."""
    is_due = and_(_is_next(table, channel), table.c.due_at_ms <= NOW_MS)
    return Claiming.of(table, where=is_due, order_by=[table.c.id])


def dropping(table: Table) -> Delete:
    """How the rows `done` with leave the table."""
    return table.delete().where(among(table.c.id, "done"))


def both(
    dropping: Delete, claiming: ReturningUpdate[*tuple[Any, ...]]
) -> ReturningUpdate[*tuple[Any, ...]]:
    """Both in one statement, as PostgreSQL allows; each sees the table as it was before."""
    return claiming.add_cte(dropping.cte("dropped"))


def freeing(table: Table) -> Update:
    """Free the row `sent_id`, unless somebody is at it: then it is being confirmed.

    Who confirms several rows holds one while it waits for the next: waiting for that one here, with
    the next in hand, would never end. A row that stays after all is free when its claim runs out.
    """
    row, this = table.alias("row_sent"), bindparam("sent_id", type_=table.c.id.type)
    untouched = select(row.c.id).where(row.c.id == this).with_for_update(skip_locked=True)
    return table.update().where(table.c.id == this, table.c.id.in_(untouched)).values(FREE)


def _is_next(table: Table, channel: str) -> ColumnElement[bool]:
    """Whether a row is the oldest of its stream on this channel, those `done` with left out."""
    columns, older = table.c, table.alias("older")
    has_older = exists().where(
        older.c.channel == columns.channel,
        older.c.stream == columns.stream,
        older.c.id < columns.id,
        ~among(older.c.id, "done"),
    )
    return and_(columns.channel == channel, ~among(columns.id, "done"), ~has_older)
