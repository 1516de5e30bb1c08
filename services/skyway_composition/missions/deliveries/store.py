"""All SQL of the deliveries: a row to lock, and the tombstone in it."""

from dataclasses import dataclass
from typing import Final

from sqlalchemy import bindparam, select, update

from skyway.ids import DeliveryId
from skyway.runtime.database import Tx
from skyway_composition.tables import deliveries

_LOCK: Final = (
    select(deliveries.c.closed_ms)
    .where(deliveries.c.delivery_id == bindparam("of_delivery"))
    .with_for_update()
)


@dataclass(frozen=True, slots=True)
class LockedDelivery:
    """A delivery that nobody else books or closes; of one that is new there are no missions."""

    is_new: bool
    is_closed: bool


async def lock_delivery(tx: Tx, delivery_id: DeliveryId) -> LockedDelivery:
    """The delivery, known from now on; others who ask wait for this one."""
    added = tx.insert(deliveries).on_conflict_do_nothing()
    known = await tx.execute(
        added.returning(deliveries.c.delivery_id), {"delivery_id": delivery_id}
    )
    if known.one_or_none() is not None:
        return LockedDelivery(is_new=True, is_closed=False)
    closed_ms = await tx.execute(_LOCK, {"of_delivery": delivery_id})
    return LockedDelivery(is_new=False, is_closed=closed_ms.scalar_one() is not None)


async def close_delivery(tx: Tx, delivery_id: DeliveryId, now_ms: int) -> None:
    """Write the tombstone: nothing is booked for this delivery any more."""
    await tx.execute(
        update(deliveries).where(deliveries.c.delivery_id == delivery_id).values(closed_ms=now_ms)
    )
