"""The SQL by which a delivery's events are read in their order."""

from collections.abc import Sequence

from sqlalchemy import select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import DeliveryId
from skyway.runtime.sql.connection import AnyRow
from skyway_gateway.tables import events


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
