"""A delivery's events as they happen, in the form of server-sent events."""

import asyncio
from collections.abc import AsyncIterator
from dataclasses import dataclass
from typing import Final

from skyway.contracts.delivery_event import DeliveryEventType
from skyway.ids import DeliveryId
from skyway.runtime.sql.database import Database
from skyway_gateway.notifications.streaming import store
from skyway_gateway.notifications.streaming.news import News

#: The last word on a delivery: its stream ends with one of these.
LAST_EVENTS: Final = frozenset(
    {
        DeliveryEventType.COMPLETED,
        DeliveryEventType.PARTIALLY_COMPLETED,
        DeliveryEventType.FAILED,
        DeliveryEventType.REJECTED,
        DeliveryEventType.CANCELLED,
    }
)

_HEARTBEAT: Final = ": still here\n\n"


@dataclass(frozen=True, slots=True)
class EventStream:
    """Streams events; seconds are of wall time."""

    db: Database
    news: News
    #: Events that another replica wrote do not ring here.
    poll_s: float = 1.0
    heartbeat_s: float = 15.0

    async def frames(self, delivery_id: DeliveryId, *, after: int) -> AsyncIterator[str]:
        """The events after this sequence as they come, up to the delivery's last."""
        loop = asyncio.get_running_loop()
        spoken_at = loop.time()
        with self.news.listen(delivery_id) as wake:
            while True:
                async with self.db.read() as connection:
                    found = await store.events_after(connection, delivery_id, after=after)
                for event in found:
                    yield f"id: {event.sequence}\nevent: {event.type}\ndata: {event.body}\n\n"
                    if event.type in LAST_EVENTS:
                        return
                    after, spoken_at = event.sequence, loop.time()
                if loop.time() - spoken_at >= self.heartbeat_s:
                    yield _HEARTBEAT
                    spoken_at = loop.time()
                await wake.wait(self.poll_s)

    async def is_over(self, delivery_id: DeliveryId, *, after: int) -> bool:
        """Whether nothing will ever come after this sequence."""
        async with self.db.read() as connection:
            last = await store.last_event(connection, delivery_id)
        return last is not None and last.type in LAST_EVENTS and last.sequence <= after
