"""A delivery's events as they happen, in the form of server-sent events."""

import asyncio
from collections import defaultdict
from collections.abc import AsyncIterator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Final

from skyway.contracts.delivery_event import DeliveryEventType
from skyway.ids import DeliveryId
from skyway.runtime.loops import Wake
from skyway.runtime.sql.database import Database
from skyway_gateway.notifications import event_store

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


class News:
    """A bell for each delivery that somebody listens to."""

    def __init__(self) -> None:
        self._listeners: dict[DeliveryId, set[Wake]] = defaultdict(set)

    @contextmanager
    def listen(self, delivery_id: DeliveryId) -> Iterator[Wake]:
        """A wake that is set at each new event of the delivery, while the block runs."""
        wake = Wake()
        self._listeners[delivery_id].add(wake)
        try:
            yield wake
        finally:
            self._listeners[delivery_id].discard(wake)
            if not self._listeners[delivery_id]:
                del self._listeners[delivery_id]

    def ring(self, delivery_id: DeliveryId) -> None:
        """Wake all who listen to the delivery."""
        for wake in self._listeners.get(delivery_id, ()):
            wake.set()

    @property
    def listener_count(self) -> int:
        """How many listen now."""
        return sum(len(wakes) for wakes in self._listeners.values())


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
                    found = await event_store.events_after(connection, delivery_id, after=after)
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
            last = await event_store.last_event(connection, delivery_id)
        return last is not None and last.type in LAST_EVENTS and last.sequence <= after
