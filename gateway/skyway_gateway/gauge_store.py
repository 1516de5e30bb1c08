"""All SQL of the gateway's gauges and rests; each statement reads an index of open rows."""

from dataclasses import dataclass
from typing import Final

from sqlalchemy import exists, func, select, text
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway_gateway.delivery_tables import IS_LIVE, deliveries, is_live_row
from skyway_gateway.tables import api_keys, notifications, outbox, sandbox_missions

_IS_REAL: Final = is_live_row(deliveries.c.customer_id)

_LIVE: Final = (
    select(deliveries.c.state, func.count())
    .where(text(IS_LIVE), _IS_REAL)
    .group_by(deliveries.c.state)
)
_BOOKING: Final = select(func.count(), func.min(deliveries.c.updated_ms)).where(
    deliveries.c.is_queued.is_(True), deliveries.c.waits_since_ms.is_(None), _IS_REAL
)
_WAITING: Final = select(func.count(), func.min(deliveries.c.waits_since_ms)).where(
    deliveries.c.waits_since_ms.is_not(None), _IS_REAL
)
_NOTIFICATIONS: Final = select(func.count(), func.min(notifications.c.next_try_wall_ms)).where(
    notifications.c.state == text("'PENDING'")
)

#: While there are such rows, time alone can make work for the loops.
OPEN_ROWS: Final = (
    exists(select(deliveries).where(text(IS_LIVE))),
    exists(select(deliveries).where(deliveries.c.is_queued)),
    exists(select(notifications).where(notifications.c.state == "PENDING")),
    exists(
        select(api_keys).where(
            api_keys.c.deleted_wall_ms.is_(None), api_keys.c.ends_wall_ms.is_not(None)
        )
    ),
    exists(select(outbox)),
    exists(select(sandbox_missions).where(sandbox_missions.c.next_wall_ms.is_not(None))),
)


@dataclass(frozen=True, slots=True)
class StoredQueue:
    """How many rows wait, and the moment from which the first of them waits; None without one."""

    depth: int
    first_ms: int | None


@dataclass(frozen=True, slots=True)
class StoredQueues:
    """The queues in the database. `webhooks` has wall time, the others fleet time."""

    booking: StoredQueue
    waiting: StoredQueue
    webhooks: StoredQueue


async def live_deliveries(connection: AsyncConnection) -> dict[str, int]:
    """The number of deliveries that are not over, by state."""
    return dict((await connection.execute(_LIVE)).all())


async def stored_queues(connection: AsyncConnection) -> StoredQueues:
    """Deliveries that are being booked, requests without a free drone, pending notifications."""
    rows = [(await connection.execute(each)).one() for each in (_BOOKING, _WAITING, _NOTIFICATIONS)]
    booking, waiting, webhooks = (StoredQueue(*row) for row in rows)
    return StoredQueues(booking, waiting, webhooks)
