"""The SQL by which new events are kept, and made due at the webhooks of their customer."""

from collections.abc import Callable, Sequence
from datetime import datetime
from typing import Any, Final

from sqlalchemy import (
    BigInteger,
    FromClause,
    Integer,
    Select,
    Text,
    bindparam,
    literal,
    or_,
    select,
)
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.delivery_event import DeliveryEvent
from skyway.ids import DeliveryId, SubjectId
from skyway.runtime.sql.connection import AnyRow
from skyway.runtime.sql.database import Tx
from skyway.runtime.sql.declared import Consequence
from skyway.units import moment_to_ms
from skyway_gateway.tables import events, notifications, webhooks


def _notifications_of(told: FromClause) -> Select[*tuple[Any, ...]]:
    """New events of a delivery, for each active webhook of their customer that wants them.

    Any: columns are of every type.
    """
    # A list of JSON texts; no type is another's but for what LIKE takes for any character.
    wanted = webhooks.c.event_types.contains('"' + told.c.type + '"')
    return select(
        webhooks.c.webhook_id,
        told.c.event_id,
        told.c.delivery_id,
        told.c.sequence,
        literal("PENDING").label("state"),
        literal(0).label("attempts"),
        bindparam("told_wall_ms", type_=BigInteger).label("next_try_wall_ms"),
    ).where(
        told.c.delivery_id == bindparam("told_of", type_=Text),
        told.c.sequence >= bindparam("told_from", type_=Integer),
        webhooks.c.customer_id == bindparam("listener", type_=Text),
        webhooks.c.state == "ACTIVE",
        or_(webhooks.c.event_types.is_(None), wanted),
    )


_NOTIFICATIONS: Final = Consequence(notifications, events, _notifications_of)


def add_events(
    tx: Tx,
    new: Sequence[DeliveryEvent],
    *,
    customer_id: SubjectId,
    wall_at: datetime,
    when_notified: Callable[[], None],
) -> None:
    """Keep a delivery's next events, one at least, in the form in which every channel has them.

    They are due at once at every active webhook that wants them. Nobody asks before whether there
    is one: webhooks are looked at by what adds the events. `when_notified` is called if so.
    """
    at_ms = moment_to_ms(wall_at)
    rows = [
        {
            "event_id": event.event_id,
            "delivery_id": event.delivery_id,
            "sequence": event.sequence,
            "type": event.type,
            "body": event.model_dump_json(),
            "recorded_wall_ms": at_ms,
        }
        for event in new
    ]
    tx.add(events, rows)
    first = new[0]
    values = {
        "told_of": first.delivery_id,
        "told_from": first.sequence,
        "listener": customer_id,
        "told_wall_ms": at_ms,
    }
    tx.follow_up(_NOTIFICATIONS, values, then=when_notified)


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
