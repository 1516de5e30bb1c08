"""All SQL of the deliveries: a row to lock, and the tombstone in it."""

from sqlalchemy import update

from skyway.ids import DeliveryId
from skyway.runtime.database import Tx
from skyway_composition.tables import deliveries


async def lock_delivery(tx: Tx, delivery_id: DeliveryId) -> int | None:
    """When the delivery was closed, None while it is open; others who ask wait for this one."""
    added = tx.insert(deliveries)
    same = {"delivery_id": added.excluded.delivery_id}
    locked = added.on_conflict_do_update(index_elements=["delivery_id"], set_=same)
    found = await tx.execute(locked.returning(deliveries.c.closed_ms), {"delivery_id": delivery_id})
    closed_ms: int | None = found.scalar_one()
    return closed_ms


async def close_delivery(tx: Tx, delivery_id: DeliveryId, now_ms: int) -> None:
    """Write the tombstone: nothing is booked for this delivery any more."""
    await tx.execute(
        update(deliveries).where(deliveries.c.delivery_id == delivery_id).values(closed_ms=now_ms)
    )
