"""The only writer of delivery events, for all channels together.

An event, its webhook notifications and its MQTT message are written in the transaction of the fact
that they report, so that none of them can be missing.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from skyway.contracts.delivery_event import DeliveryEvent, DeliveryEventType
from skyway.contracts.topics import DELIVERY_EVENTS
from skyway.ids import DeliveryId, EventId, SubjectId
from skyway.runtime.clock import FleetClock
from skyway.runtime.loops import Wake
from skyway.runtime.metrics import count
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Tx
from skyway.runtime.tracing import current_traceparent
from skyway.units import moment_to_ms
from skyway_gateway.notifications.event_store import NumberedEvent, add_events
from skyway_gateway.notifications.stream_events import EventListeners


@dataclass(frozen=True, slots=True)
class Happening:
    """Something to notify the customer of, before it has a number in the sequence."""

    type: DeliveryEventType
    occurred_at: datetime
    #: The event's own JSON members; each event type has others.
    data: dict[str, Any] = field(default_factory=dict)


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
        for each in new:
            address = DELIVERY_EVENTS(customer_id, delivery_id)
            tx.send(address, each.event, confirmed_by="broker", stream=delivery_id)
        tx.after_commit(lambda: self._announce(delivery_id, new))

    def _announce(self, delivery_id: DeliveryId, new: Sequence[NumberedEvent]) -> None:
        self._listeners.wake(delivery_id)
        for each in new:
            count("skyway_delivery_events", "events recorded for customers", type=each.event.type)

    def _event(self, happening: Happening, delivery_id: DeliveryId, sequence: int) -> NumberedEvent:
        event = DeliveryEvent(
            message_id=self._mint("msg"),
            sent_at=self._clock.now(),
            traceparent=current_traceparent(),
            event_id=EventId(self._mint("evt")),
            type=happening.type,
            delivery_id=delivery_id,
            sequence=sequence,
            occurred_at=happening.occurred_at,
            data=happening.data,
        )
        recorded_wall_ms = moment_to_ms(self._clock.wall_now())
        return NumberedEvent(event, event.model_dump_json(), recorded_wall_ms)
