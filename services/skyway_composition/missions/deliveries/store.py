"""All SQL of the deliveries: a row to lock, and the tombstone in it."""

from typing import Final

from sqlalchemy import bindparam, select, update

from skyway.ids import DeliveryId
from skyway.runtime.database import Tx
from skyway_composition.tables import deliveries

_CLOSED_MS: Final = (
    select(deliveries.c.closed_ms)
    .where(deliveries.c.delivery_id == bindparam("delivery_id"))
    .with_for_update()
)


async def lock_delivery(tx: Tx, delivery_id: DeliveryId) -> int | None:
    """When the delivery was closed, None while it is open; others who ask wait for this one."""
    this = {"delivery_id": delivery_id}
    await tx.execute(tx.insert(deliveries).on_conflict_do_nothing(), this)
    found = await tx.execute(_CLOSED_MS, this)
    closed_ms: int | None = found.scalar_one()
    return closed_ms


async def close_delivery(tx: Tx, delivery_id: DeliveryId, now_ms: int) -> None:
    """Write the tombstone: nothing is booked for this delivery any more."""
    await tx.execute(
        update(deliveries).where(deliveries.c.delivery_id == delivery_id).values(closed_ms=now_ms)
    )
