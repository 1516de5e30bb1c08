"""Streams a delivery's events as they happen, as server-sent events."""

import asyncio
from collections import defaultdict
from collections.abc import AsyncGenerator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Final

from skyway.contracts.delivery_event import DeliveryEventType
from skyway.ids import DeliveryId
from skyway.runtime.loops import Wake
from skyway.runtime.sql.database import Database
from skyway_gateway.notifications import event_store

#: The final event of a delivery is one of these; its stream ends there.
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


class EventListeners:
    """The listeners in this process, by the delivery whose new events they wait for."""

    def __init__(self) -> None:
        self._listeners: dict[DeliveryId, set[Wake]] = defaultdict(set)

    @contextmanager
    def listen(self, delivery_id: DeliveryId) -> Iterator[Wake]:
        """A wake that each new event of the delivery sets, while the block runs."""
        wake = Wake()
        self._listeners[delivery_id].add(wake)
        try:
            yield wake
        finally:
            self._listeners[delivery_id].discard(wake)
            if not self._listeners[delivery_id]:
                del self._listeners[delivery_id]

    def wake(self, delivery_id: DeliveryId) -> None:
        """Wake all listeners of the delivery."""
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
    listeners: EventListeners
    #: Events of other replicas do not wake the listeners here, so the table is read again.
    poll_s: float = 1.0
    heartbeat_s: float = 15.0

    async def frames(self, delivery_id: DeliveryId, *, after: int) -> AsyncGenerator[str]:
        """The events after this sequence number as they come, up to the final event."""
        loop = asyncio.get_running_loop()
        spoken_at = loop.time()
        with self.listeners.listen(delivery_id) as wake:
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
        """Whether no event will ever follow this sequence number."""
        async with self.db.read() as connection:
            last = await event_store.last_event(connection, delivery_id)
        return last is not None and last.type in LAST_EVENTS and last.sequence <= after
