"""Records delivery events for all channels together, and streams them as server-sent events.

`EventRecorder` is their only writer. An event, its webhook notifications and its MQTT message are
written in the transaction of the fact that they report, so that none of them can be missing.
"""

import asyncio
from collections import defaultdict
from collections.abc import AsyncGenerator, Awaitable, Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, Final

from skyway.contracts.delivery_event import DeliveryEvent, DeliveryEventType
from skyway.contracts.topics import DELIVERY_EVENTS
from skyway.ids import DeliveryId, EventId, SubjectId, is_live_id
from skyway.runtime.clock import FleetClock
from skyway.runtime.loops import Wake
from skyway.runtime.metrics import count
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Database, Tx
from skyway.runtime.tracing import current_traceparent
from skyway.units import moment_to_ms
from skyway_gateway.notifications import event_store
from skyway_gateway.notifications.event_store import NumberedEvent, add_events

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


@dataclass(frozen=True, slots=True)
class Happening:
    """Something to notify the customer of, before it has a number in the sequence."""

    type: DeliveryEventType
    occurred_at: datetime
    #: The event's own JSON members; each event type has others.
    data: dict[str, Any] = field(default_factory=dict)


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


class EventRecorder:
    """Records events; `webhooks` wakes the sender when a webhook is to be notified."""

    def __init__(
        self, *, clock: FleetClock, mint: Mint, listeners: EventListeners, webhooks: Wake
    ) -> None:
        self._clock = clock
        self._mint = mint
        self._listeners = listeners
        self._webhooks = webhooks

    def number(
        self, happenings: Sequence[Happening], *, after: int, delivery_id: DeliveryId
    ) -> tuple[NumberedEvent, ...]:
        """The events of what happened, in this order.

        `after` is the number of events that the delivery had, as its row counts them. The
        transaction that records them also writes that row, so no other transaction can use the
        same numbers.
        """
        return tuple(
            self._event(happening, delivery_id, sequence)
            for sequence, happening in enumerate(happenings, start=after + 1)
        )

    def record(self, tx: Tx, new: Sequence[NumberedEvent], *, customer_id: SubjectId) -> None:
        """Record a delivery's next events; they are sent once the transaction is committed."""
        if not new:
            return
        add_events(tx, new, customer_id=customer_id, when_notified=self._webhooks.set)
        delivery_id = new[0].event.delivery_id
        address = DELIVERY_EVENTS(customer_id, delivery_id)
        # Test accounts have no broker account that could read them.
        for each in new if is_live_id(delivery_id) else ():
            tx.send(address, each.event, confirmed_by="broker", stream=delivery_id)
        tx.after_commit(lambda: self._announce(delivery_id, new))

    def _announce(self, delivery_id: DeliveryId, new: Sequence[NumberedEvent]) -> None:
        self._listeners.wake(delivery_id)
        for each in new if is_live_id(delivery_id) else ():
            count("skyway_delivery_events", "events recorded for customers", type=each.event.type)

    def _event(self, happening: Happening, delivery_id: DeliveryId, sequence: int) -> NumberedEvent:
        event = DeliveryEvent(
            message_id=self._mint("msg"),
            sent_at=self._clock.now(),
            traceparent=current_traceparent(),
            event_id=EventId(self._mint("evt")),
            type=happening.type,
            delivery_id=delivery_id,
            livemode=is_live_id(delivery_id),
            sequence=sequence,
            occurred_at=happening.occurred_at,
            data=happening.data,
        )
        recorded_wall_ms = moment_to_ms(self._clock.wall_now())
        return NumberedEvent(event, event.model_dump_json(), recorded_wall_ms)


@dataclass(frozen=True, slots=True)
class EventStream:
    """Streams events; seconds are of wall time."""

    db: Database
    listeners: EventListeners
    #: Events of other replicas do not wake the listeners here, so the table is read again.
    poll_s: float = 1.0
    #: How often a silent stream asks whether the caller may still read it.
    check_s: float = 0.4
    heartbeat_s: float = 15.0

    async def frames(
        self, delivery_id: DeliveryId, *, after: int, may_read: Callable[[], Awaitable[bool]]
    ) -> AsyncGenerator[str]:
        """The events after this sequence number as they come, up to the final event.

        They also end when the caller may no longer read them.
        """
        loop = asyncio.get_running_loop()
        spoken_at = loop.time()
        with self.listeners.listen(delivery_id) as wake:
            while await may_read():
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
                poll_at = loop.time() + self.poll_s
                while not await wake.wait(min(self.check_s, self.poll_s)):
                    if loop.time() >= poll_at or not await may_read():
                        break

    async def is_over(self, delivery_id: DeliveryId, *, after: int) -> bool:
        """Whether no event will ever follow this sequence number."""
        async with self.db.read() as connection:
            last = await event_store.last_event(connection, delivery_id)
        return last is not None and last.type in LAST_EVENTS and last.sequence <= after
