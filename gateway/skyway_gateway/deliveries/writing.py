"""The one way to write a delivery: as it is now, together with what is told of it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from skyway.contracts.mission import MissionReport
from skyway.ids import DeliveryId
from skyway.runtime.database import Database, Tx
from skyway_gateway.deliveries import store
from skyway_gateway.deliveries.delivery import Delivery
from skyway_gateway.deliveries.known import Known, KnownDeliveries
from skyway_gateway.deliveries.progress import Progress
from skyway_gateway.deliveries.rows import Queued
from skyway_gateway.notifications.events import Events, Happening, Place
from skyway_gateway.notifications.store import has_webhooks

#: A delivery as it is now to what becomes of it; None where it does not apply any more.
Change = Callable[[Delivery], Progress | None]


@dataclass(frozen=True, slots=True)
class DeliveryWriter:
    """Writes deliveries; `known` are those that it has written."""

    db: Database
    events: Events
    known: KnownDeliveries

    async def write(self, delivery_id: DeliveryId, *, change: Change) -> None:
        """Change a delivery in a transaction of its own; one that is over stays as it is."""
        async with self.db.write() as tx:
            # The lock comes first: what was read earlier may be out of date.
            now = await store.lock(tx, delivery_id)
            if now.delivery.is_over:
                return
            progress = change(now.delivery)
            if progress is not None:
                await self.keep(tx, now, progress)

    async def add(self, tx: Tx, queued: Queued, first: Happening) -> None:
        """Keep a delivery that was just accepted, and tell it."""
        # Asked on another connection: what is only added then takes one statement, and no BEGIN.
        async with self.db.read() as connection:
            listens = await has_webhooks(connection, queued.known.delivery.customer_id)
        store.add(tx, queued)
        await self._tell(tx, queued.known, [first], Place(0, listens))

    async def keep(
        self, tx: Tx, before: Known, progress: Progress, *, report: MissionReport | None = None
    ) -> None:
        """Keep what became of a delivery, with the report that said so, and tell it.

        Raises
        ------
        Outdated
            It was not locked, and is not any more what it was `before`.
        """
        delivery, happenings = progress.delivery, progress.happenings
        if report is None and delivery == before.delivery and not happenings:
            return
        after = before.then(delivery, new_events=len(happenings))
        listens = await store.save(tx, before, after, report=report)
        await self._tell(tx, after, happenings, Place(before.last_sequence, listens))

    async def _tell(
        self, tx: Tx, after: Known, happenings: Sequence[Happening], place: Place
    ) -> None:
        delivery = after.delivery
        await self.events.tell(
            tx,
            happenings,
            place,
            delivery_id=delivery.delivery_id,
            customer_id=delivery.customer_id,
        )
        tx.after_commit(lambda: self.known.note(after))
