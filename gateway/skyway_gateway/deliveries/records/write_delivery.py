"""The one way to write a delivery: as it is now, together with what is told of it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime

from skyway.contracts.mission import MissionReport
from skyway.ids import DeliveryId
from skyway.runtime.sql.database import Database, Tx
from skyway_gateway.deliveries.lifecycle.delivery import Delivery
from skyway_gateway.deliveries.lifecycle.progress import Progress
from skyway_gateway.deliveries.records import delivery_store
from skyway_gateway.deliveries.records import saving_store as saving
from skyway_gateway.deliveries.records.stored_delivery import Known, KnownDeliveries, Queued
from skyway_gateway.notifications.record_events import Events, Happening

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
            now = await delivery_store.lock(tx, delivery_id)
            if now.delivery.is_over:
                return
            progress = change(now.delivery)
            if progress is not None:
                self.keep(tx, now, progress)

    def add(self, tx: Tx, queued: Queued, first: Happening, *, claim: Mapping[str, object]) -> None:
        """Keep a delivery that was just accepted, claimed or not, and tell it."""
        saving.add(tx, queued, claim=claim)
        self._tell(tx, queued.known, [first], after=0)

    def keep(
        self,
        tx: Tx,
        before: Known,
        progress: Progress,
        *,
        report: MissionReport | None = None,
        give_up_at: datetime | None = None,
    ) -> None:
        """Keep what became of a delivery, with the report that said so, and tell it.

        It is written when the block ends, which raises Outdated if the delivery was not locked,
        and is not any more what it was `before`: then nothing is written. What waits is given up
        at another moment from now on, if there is one.
        """
        delivery, happenings = progress.delivery, progress.happenings
        if report is None and delivery == before.delivery and not happenings:
            return
        after = before.then(delivery, new_events=len(happenings))
        saving.save(tx, before, after, report=report, give_up_at=give_up_at)
        self._tell(tx, after, happenings, after=before.last_sequence)

    def _tell(self, tx: Tx, now: Known, happenings: Sequence[Happening], *, after: int) -> None:
        delivery = now.delivery
        self.events.tell(
            tx,
            happenings,
            after=after,
            delivery_id=delivery.delivery_id,
            customer_id=delivery.customer_id,
        )
        tx.after_commit(lambda: self.known.note(now))
