"""The SQL of requests that wait for a drone: their order, and waking the first of them."""

from collections.abc import Sequence
from datetime import datetime
from typing import Final

from sqlalchemy import BigInteger, bindparam, case, func, or_, select, update

from skyway.contracts.candidate import ProviderReason
from skyway.ids import NetworkId
from skyway.runtime.sql.claims import FREE, NOW_MS
from skyway.runtime.sql.database import Database, Tx
from skyway.units import moment_to_ms
from skyway_gateway.deliveries.records.delivery_rows import reasons_text
from skyway_gateway.deliveries.records.delivery_store import NEXT_VERSION
from skyway_gateway.deliveries.records.stored_delivery import QueuedDelivery
from skyway_gateway.tables import deliveries

#: How many waiting requests of a network one change wakes. A change frees one drone as a rule, and
#: the first of them may not fit it. The others are tried again by and by.
_WOKEN: Final = 4

_waits = deliveries.c.waits_since_ms.is_not(None)
_place = func.row_number().over(
    partition_by=deliveries.c.network_id,
    order_by=(deliveries.c.queue_rank, deliveries.c.created_ms, deliveries.c.delivery_id),
)
_WAITING_NETWORKS: Final = select(deliveries.c.network_id).where(_waits).distinct()


async def wait_longer(
    tx: Tx,
    queued: QueuedDelivery,
    *,
    now: datetime,
    next_try_at: datetime,
    reasons: Sequence[ProviderReason],
) -> None:
    """Leave a delivery in the queue because no drone is free.

    If something has woken it since it was claimed, it is tried again immediately. `now` is fleet
    time, `next_try_at` wall time.
    """
    is_as_claimed = deliveries.c.woken_wall_ms == queued.woken_wall_ms
    values = {
        "next_try_wall_ms": case((is_as_claimed, moment_to_ms(next_try_at)), else_=0),
        "waits_since_ms": func.coalesce(deliveries.c.waits_since_ms, moment_to_ms(now)),
        "reasons": reasons_text(reasons),
        **NEXT_VERSION,
        **FREE,
    }
    this = deliveries.c.delivery_id == queued.delivery.delivery_id
    await tx.execute(update(deliveries).where(this, deliveries.c.is_queued).values(values))


async def line_up(tx: Tx, queued: QueuedDelivery, *, now: datetime) -> None:
    """Let a new delivery wait behind those that wait already; it is due immediately."""
    values = {"waits_since_ms": moment_to_ms(now), "next_try_wall_ms": 0, **FREE}
    this = deliveries.c.delivery_id == queued.delivery.delivery_id
    await tx.execute(update(deliveries).where(this, deliveries.c.is_queued).values(values))


async def waiting_networks(db: Database) -> frozenset[NetworkId | None]:
    """The networks in which requests wait; None stands for requests whose network is unknown."""
    async with db.read() as connection:
        return frozenset((await connection.execute(_WAITING_NETWORKS)).scalars())


async def wake_first(db: Database, network_id: NetworkId | None, *, wall_at: datetime) -> bool:
    """Try the first waiting requests of a network again; None means of every network.

    Returns whether there are any. Rows are locked in the order of their ids, as `hold` does, so
    that the two cannot wait for each other.
    """
    of_network = or_(deliveries.c.network_id == network_id, deliveries.c.network_id.is_(None))
    waiting = select(deliveries.c.delivery_id, _place.label("place")).where(_waits)
    if network_id is not None:
        waiting = waiting.where(of_network)
    placed = waiting.subquery()
    first = (
        select(deliveries.c.delivery_id)
        .where(
            deliveries.c.delivery_id.in_(
                select(placed.c.delivery_id).where(placed.c.place <= _WOKEN)
            )
        )
        .order_by(deliveries.c.delivery_id)
        .with_for_update()
        .cte("first")
    )
    now_ms = bindparam("now_ms", type_=BigInteger)
    statement = (
        update(deliveries)
        .where(deliveries.c.delivery_id.in_(select(first.c.delivery_id)), _waits)
        .values(next_try_wall_ms=0, woken_wall_ms=now_ms)
        .returning(deliveries.c.delivery_id)
    )
    return bool(await db.write_alone(statement, {NOW_MS.key: moment_to_ms(wall_at)}))
