"""The SQL that adds events, makes them due at the customer's webhooks, and reads them in order."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Final

from sqlalchemy import (
    BigInteger,
    FromClause,
    Integer,
    Select,
    Text,
    bindparam,
    insert,
    literal,
    or_,
    select,
)
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.delivery_event import DeliveryEvent
from skyway.contracts.statement_event import StatementClosed
from skyway.ids import DeliveryId, SubjectId
from skyway.runtime.hash_chain import next_hash
from skyway.runtime.sql.bulk_write import DerivedRows
from skyway.runtime.sql.connection import AnyRow
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms
from skyway_gateway.tables import events, notifications, webhooks


@dataclass(frozen=True, slots=True)
class NumberedEvent:
    """A delivery's next event in the form that all channels send, and when it is recorded."""

    event: DeliveryEvent
    body: str
    recorded_wall_ms: int


def hash_after(previous: str, *, body: str, recorded_wall_ms: int) -> str:
    """The hash of a delivery's events, after one more event."""
    return next_hash(previous, str(recorded_wall_ms), body)


def _notifications_of(added: FromClause) -> Select[*tuple[Any, ...]]:
    """One notification for each new event and each active webhook that subscribes to its type.

    Columns are typed as Any, since they have every type.
    """
    return _due_at_webhooks(added).where(
        added.c.delivery_id == bindparam("added_to", type_=Text),
        added.c.sequence >= bindparam("added_from", type_=Integer),
    )


def _due_at_webhooks(added: FromClause) -> Select[*tuple[Any, ...]]:
    # `event_types` is a JSON list of texts: the quotes keep one type from matching another.
    subscribes = webhooks.c.event_types.contains('"' + added.c.type + '"')
    return select(
        webhooks.c.webhook_id,
        added.c.event_id,
        added.c.delivery_id,
        added.c.sequence,
        literal("PENDING").label("state"),
        literal(0).label("attempts"),
        bindparam("added_wall_ms", type_=BigInteger).label("next_try_wall_ms"),
    ).where(
        webhooks.c.customer_id == bindparam("listener", type_=Text),
        webhooks.c.state == "ACTIVE",
        or_(webhooks.c.event_types.is_(None), subscribes),
    )


_NOTIFICATIONS: Final = DerivedRows(notifications, events, _notifications_of)


def add_events(
    tx: Tx,
    new: Sequence[NumberedEvent],
    *,
    customer_id: SubjectId,
    when_notified: Callable[[], None],
) -> None:
    """Add a delivery's next events, at least one.

    The same statement makes them due at each active webhook that subscribes to them.
    `when_notified` is called if there is such a webhook.
    """
    rows = [
        {
            "event_id": each.event.event_id,
            "delivery_id": each.event.delivery_id,
            "sequence": each.event.sequence,
            "type": each.event.type,
            "body": each.body,
            "recorded_wall_ms": each.recorded_wall_ms,
        }
        for each in new
    ]
    tx.add(events, rows)
    first = new[0].event
    values = {
        "added_to": first.delivery_id,
        "added_from": first.sequence,
        "listener": customer_id,
        "added_wall_ms": new[0].recorded_wall_ms,
    }
    tx.add_derived(_NOTIFICATIONS, values, on_added=when_notified)


async def add_statement_event(
    tx: Tx, event: StatementClosed, *, customer_id: SubjectId, at: datetime
) -> None:
    """Add an event about a month, and make it due at the customer's webhooks now, wall time."""
    at_ms = moment_to_ms(at)
    row = {
        **event.model_dump(include={"event_id", "delivery_id", "sequence", "type"}),
        "body": event.model_dump_json(),
        "recorded_wall_ms": at_ms,
    }
    await tx.execute(insert(events).values(row))
    names = [column.name for column in _due_at_webhooks(events).selected_columns]
    this = _due_at_webhooks(events).where(events.c.event_id == event.event_id)
    due = insert(notifications).from_select(names, this)
    await tx.execute(due, {"listener": customer_id, "added_wall_ms": at_ms})


async def events_after(
    connection: AsyncConnection, delivery_id: DeliveryId, *, after: int
) -> Sequence[AnyRow]:
    """The events after a sequence: sequence, type, body."""
    statement = (
        select(events.c.sequence, events.c.type, events.c.body)
        .where(events.c.delivery_id == delivery_id, events.c.sequence > after)
        .order_by(events.c.sequence)
    )
    return (await connection.execute(statement)).all()


async def last_event(connection: AsyncConnection, delivery_id: DeliveryId) -> AnyRow | None:
    """The newest event: sequence, type."""
    statement = (
        select(events.c.sequence, events.c.type)
        .where(events.c.delivery_id == delivery_id)
        .order_by(events.c.sequence.desc())
        .limit(1)
    )
    return (await connection.execute(statement)).first()
