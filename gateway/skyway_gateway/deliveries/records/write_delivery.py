"""The only way to write a delivery: its new state and its events in one transaction."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime

from skyway.contracts.mission import CancelMissions, Mission
from skyway.contracts.mission_reports import MissionReport
from skyway.ids import DeliveryId, PackageId
from skyway.runtime.clock import FleetClock
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Database, Tx
from skyway.runtime.tracing import in_trace_of
from skyway_gateway.clients import CANCELLATIONS_PATH
from skyway_gateway.deliveries.lifecycle.booking_effects import after_booking, cancelled_meanwhile
from skyway_gateway.deliveries.lifecycle.delivery import Delivery
from skyway_gateway.deliveries.lifecycle.progress import Progress
from skyway_gateway.deliveries.records import delivery_store
from skyway_gateway.deliveries.records.delivery_rows import (
    DeliveryCache,
    QueuedDelivery,
    StoredDelivery,
)
from skyway_gateway.deliveries.records.exchange_store import add_exchanges
from skyway_gateway.deliveries.records.new_lines import new_lines
from skyway_gateway.ledger.store import add_lines
from skyway_gateway.notifications.delivery_events import EventRecorder, Happening
from skyway_gateway.notifications.event_store import NumberedEvent

#: What a change makes of the delivery as it is now; None when the change no longer applies.
Change = Callable[[Delivery], Progress | None]


def report_cancellation(
    tx: Tx,
    delivery: Delivery,
    package_ids: tuple[PackageId, ...],
    *,
    reason: str,
    cancellation_id: str,
) -> None:
    """Ask composition to cancel packages of a mission that was booked too late for them."""
    body = CancelMissions(cancellation_id=cancellation_id, package_ids=package_ids, reason=reason)
    path = CANCELLATIONS_PATH.format(delivery_id=delivery.delivery_id)
    tx.report("composition", path, body, stream=delivery.delivery_id)


@dataclass(frozen=True, slots=True)
class DeliveryWriter:
    """Writes deliveries; `cache` holds what it has written."""

    db: Database
    events: EventRecorder
    cache: DeliveryCache
    clock: FleetClock

    async def write(self, delivery_id: DeliveryId, *, change: Change) -> None:
        """Change a delivery in its own transaction; a delivery that is over does not change."""
        async with self.db.write() as tx:
            # Lock before the read: what was read earlier may be out of date.
            now = await delivery_store.lock(tx, delivery_id)
            if now.delivery.is_over:
                return
            progress = change(now.delivery)
            if progress is not None:
                self.save(tx, now, progress)

    def add(
        self,
        tx: Tx,
        accepted: QueuedDelivery,
        first: Sequence[Happening],
        *,
        claim: Mapping[str, object],
    ) -> QueuedDelivery:
        """Add a delivery that was just accepted, with its first events; returns what is stored."""
        delivery = accepted.delivery
        events = self.events.number(first, after=0, delivery_id=delivery.delivery_id)
        queued = replace(accepted, stored=accepted.stored.then(delivery, events))
        delivery_store.add(tx, queued, claim=claim)
        self._record(tx, queued.stored, events)
        return queued

    def save(
        self,
        tx: Tx,
        before: StoredDelivery,
        progress: Progress,
        *,
        report: MissionReport | None = None,
        give_up_at: datetime | None = None,
    ) -> None:
        """Save what became of a delivery, with its events and the report that caused them.

        The write happens when the transaction block ends. If the delivery was not locked and has
        another version than `before`, the block raises Outdated and writes nothing. `give_up_at`
        replaces the moment at which booking gives up the packages that wait. The events are in the
        trace of the delivery's request.
        """
        delivery, happenings = progress.delivery, progress.happenings
        if report is None and delivery == before.delivery and not happenings:
            return
        with in_trace_of(before.traceparent):
            events = self.events.number(
                happenings, after=before.last_sequence, delivery_id=delivery.delivery_id
            )
            after = before.then(delivery, events)
            delivery_store.save(tx, before, after, report=report, give_up_at=give_up_at)
            add_lines(tx, new_lines(before.delivery, delivery, at=self.clock.now()))
            add_exchanges(tx, before.delivery, events)
            self._record(tx, after, events)

    def save_plan(
        self,
        tx: Tx,
        stored: StoredDelivery,
        *,
        missions: Sequence[Mission],
        late_share: float | None,
        at: datetime,
        mint: Mint,
    ) -> None:
        """Save booked missions; packages that were cancelled meanwhile are cancelled there too."""
        delivery = stored.delivery
        if delivery.is_queued:
            self.save(tx, stored, after_booking(delivery, missions, at=at, late_share=late_share))
        if package_ids := cancelled_meanwhile(delivery, missions):
            reason, number = "cancelled during booking", mint("cxl")
            report_cancellation(tx, delivery, package_ids, reason=reason, cancellation_id=number)

    def _record(self, tx: Tx, now: StoredDelivery, new: Sequence[NumberedEvent]) -> None:
        self.events.record(tx, new, customer_id=now.delivery.customer_id)
        tx.after_commit(lambda: self.cache.remember(now))
