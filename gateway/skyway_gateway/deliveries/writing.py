"""The one way to write a delivery: as it is now, under a lock, together with what is told of it."""

from collections.abc import Callable

from skyway.ids import DeliveryId
from skyway.runtime.database import Database, Tx
from skyway_gateway.deliveries import store
from skyway_gateway.deliveries.delivery import Delivery
from skyway_gateway.deliveries.progress import Progress
from skyway_gateway.notifications.events import Events

#: A delivery as it is now to what becomes of it; None where it does not apply any more.
Change = Callable[[Delivery], Progress | None]


async def write(db: Database, events: Events, delivery_id: DeliveryId, *, change: Change) -> None:
    """Change a delivery in a transaction of its own; one that is over stays as it is."""
    async with db.write() as tx:
        # The lock comes first: what was read earlier may be out of date.
        delivery = await store.lock(tx, delivery_id)
        if delivery.is_over:
            return
        progress = change(delivery)
        if progress is not None:
            await keep(tx, events, delivery, progress)


async def keep(tx: Tx, events: Events, before: Delivery, progress: Progress) -> None:
    """Keep what became of a locked delivery, and tell it."""
    if progress.delivery == before and not progress.happenings:
        return
    place = await store.save(tx, before, progress.delivery, new_events=len(progress.happenings))
    await events.tell(
        tx,
        progress.happenings,
        place,
        delivery_id=before.delivery_id,
        customer_id=before.customer_id,
    )
