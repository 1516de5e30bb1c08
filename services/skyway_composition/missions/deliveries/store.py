"""All SQL of the deliveries: a row to lock, and the tombstone in it."""

from typing import Final

from sqlalchemy import bindparam, select, update

from skyway.ids import DeliveryId
from skyway.runtime.sql.database import Tx
from skyway_composition.tables import deliveries

_LOCK: Final = (
    select(deliveries.c.closed_ms)
    .where(deliveries.c.delivery_id == bindparam("of_delivery"))
    .with_for_update()
)


async def lock_delivery(tx: Tx, delivery_id: DeliveryId) -> bool:
    """Whether the delivery, known from now on, is closed; others who ask wait for this one."""
    wanted = {"of_delivery": delivery_id}
    found = (await tx.execute(_LOCK, wanted)).one_or_none()
    if found is None:
        added = tx.insert(deliveries).on_conflict_do_nothing()
        await tx.execute(added, {"delivery_id": delivery_id})
        found = (await tx.execute(_LOCK, wanted)).one()
    return found.closed_ms is not None


def add_delivery(tx: Tx, delivery_id: DeliveryId) -> None:
    """Know a delivery when the block ends.

    Then `deliveries_pkey` is `Taken` if somebody else came to know it meanwhile.
    """
    tx.add(deliveries, [{"delivery_id": delivery_id}])


async def close_delivery(tx: Tx, delivery_id: DeliveryId, now_ms: int) -> None:
    """Write the tombstone: nothing is booked for this delivery any more."""
    await tx.execute(
        update(deliveries).where(deliveries.c.delivery_id == delivery_id).values(closed_ms=now_ms)
    )
