"""Notifies customers of late deliveries even when no mission report says so."""

from dataclasses import dataclass
from datetime import timedelta
from typing import Final

from skyway.runtime.clock import FleetClock
from skyway.runtime.sql.database import Database
from skyway_gateway.deliveries.lifecycle.delivery import Delivery
from skyway_gateway.deliveries.lifecycle.lateness import TOLERANCE_S, when_overdue
from skyway_gateway.deliveries.lifecycle.progress import Progress
from skyway_gateway.deliveries.records import delivery_store
from skyway_gateway.deliveries.records.write_delivery import DeliveryWriter

#: How many deliveries one step looks at.
_BATCH: Final = 100


@dataclass(frozen=True, slots=True)
class OverdueNotifier:
    """Records `delivery.delayed` when an ETA has passed without a hand-over."""

    db: Database
    writer: DeliveryWriter
    clock: FleetClock

    async def step(self) -> bool:
        """One step of the loop: look at overdue deliveries; True when there may be more."""
        before = self.clock.now() - timedelta(seconds=TOLERANCE_S)
        async with self.db.read() as connection:
            found = await delivery_store.overdue(connection, before=before, limit=_BATCH)
        for delivery_id in found:
            await self.writer.write(delivery_id, change=self._marked_late)
        return len(found) == _BATCH

    def _marked_late(self, delivery: Delivery) -> Progress:
        return Progress(*when_overdue(delivery, at=self.clock.now()))
