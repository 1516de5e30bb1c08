"""The booking horizon: requests with a later pickup wait as SCHEDULED, and hold nothing.

The horizon is a span of fleet time, and a delivery stores only its pickup. So a changed setting or
clock rate counts from the next look on, for deliveries that wait already too.
"""

from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Final

from skyway.delivery.request import DeliveryRequest
from skyway.ids import DeliveryId
from skyway.runtime.clock import FleetClock
from skyway.runtime.loops import Wake
from skyway.runtime.sql.database import Database
from skyway_gateway.deliveries.booking.queue_store import scheduled_until
from skyway_gateway.deliveries.lifecycle.booking_effects import give_up_at
from skyway_gateway.deliveries.lifecycle.progress import Progress, changed
from skyway_gateway.deliveries.records import delivery_store
from skyway_gateway.deliveries.records.write_delivery import DeliveryWriter

#: How many deliveries one step opens.
_BATCH: Final = 100


def books_from(request: DeliveryRequest, horizon: timedelta) -> datetime | None:
    """The moment from which a drone may be booked, fleet time.

    None without an earliest pickup, and without windows that all open later.
    """
    first_at = request.first_hand_over_at
    return None if first_at is None else first_at - horizon


@dataclass(frozen=True, slots=True)
class ScheduleOpener:
    """Requests the SCHEDULED deliveries whose pickup has come within the horizon.

    A SCHEDULED delivery whose cancellation was begun and not ended is requested too: booking
    finishes the cancellation.
    """

    db: Database
    writer: DeliveryWriter
    clock: FleetClock
    queued: Wake
    horizon: timedelta

    async def step(self) -> bool:
        """One step of the loop; True when more deliveries may be due."""
        until = self.clock.now() + self.horizon
        async with self.db.read() as connection:
            found = await scheduled_until(connection, until, limit=_BATCH)
        for delivery_id in found:
            await self._request(delivery_id)
        return len(found) == _BATCH

    async def _request(self, delivery_id: DeliveryId) -> None:
        async with self.db.write() as tx:
            # Lock before the read: the customer may cancel it, or another replica request it.
            now = await delivery_store.lock(tx, delivery_id)
            if now.delivery.state != "SCHEDULED":
                return
            after = changed(now.delivery, state="REQUESTED", updated_at=self.clock.now())
            give_up = give_up_at(after.request, self.clock)
            self.writer.save(tx, now, Progress(after), give_up_at=give_up)
            tx.after_commit(self.queued.set)
