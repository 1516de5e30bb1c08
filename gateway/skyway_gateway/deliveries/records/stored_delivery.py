"""Deliveries as the database holds them, and a cache of those that this process wrote last.

The cache saves the next step a read. It cannot do harm when it is out of date: each write names the
version that it starts from, and a row with another version is not written.
"""

from collections import OrderedDict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Final

from skyway.geo import Position
from skyway.ids import DeliveryId, NetworkId
from skyway_gateway.deliveries.lifecycle.delivery import Delivery
from skyway_gateway.notifications.event_store import NumberedEvent, hash_after

#: How many are cached. A busy gateway accepts as many in some seconds; most are dispatched by then.
_MOST_CACHED: Final = 500


class Outdated(Exception):
    """Somebody wrote the delivery after it was read: read it again, under a lock."""


@dataclass(frozen=True, slots=True)
class StoredDelivery:
    """A delivery, the version of its row, and the number and the hash of its events so far.

    `traceparent` is that of its request: all that is said about the delivery is in its trace. A
    cached delivery may hold moments that are more exact than the stored milliseconds.
    """

    delivery: Delivery
    version: int = 0
    last_sequence: int = 0
    events_hash: str = ""
    traceparent: str | None = None

    def then(self, delivery: Delivery, new_events: Sequence[NumberedEvent]) -> "StoredDelivery":
        """The next version, which holds this delivery and has these events more."""
        events_hash = self.events_hash
        for each in new_events:
            events_hash = hash_after(
                events_hash, body=each.body, recorded_wall_ms=each.recorded_wall_ms
            )
        sequence = self.last_sequence + len(new_events)
        return StoredDelivery(delivery, self.version + 1, sequence, events_hash, self.traceparent)


class DeliveryCache:
    """Holds the deliveries that were written last; all others are read from the database."""

    def __init__(self) -> None:
        self._cached: OrderedDict[DeliveryId, StoredDelivery] = OrderedDict()

    def pop(self, delivery_id: DeliveryId) -> StoredDelivery | None:
        """Remove a delivery from the cache, to write its next version; None when it is not cached.

        `remember` puts it back after the commit. If the write fails, the next step reads it.
        """
        return self._cached.pop(delivery_id, None)

    def matching(
        self, versions: Iterable[tuple[DeliveryId, int]]
    ) -> dict[DeliveryId, StoredDelivery]:
        """The cached deliveries among these that have exactly the given version."""
        pairs = ((self._cached.get(delivery_id), version) for delivery_id, version in versions)
        return {
            stored.delivery.delivery_id: stored
            for stored, version in pairs
            if stored is not None and stored.version == version
        }

    def remember(self, stored: StoredDelivery) -> None:
        """Cache what was just committed."""
        delivery = stored.delivery
        before = self._cached.pop(delivery.delivery_id, stored)
        if any(mission.state == "REFUSED" for mission in delivery.missions):
            return  # the database answers without the refused mission
        self._cached[delivery.delivery_id] = max(before, stored, key=lambda one: one.version)
        if len(self._cached) > _MOST_CACHED:
            self._cached.popitem(last=False)


@dataclass(frozen=True, slots=True)
class QueuedDelivery:
    """A delivery with packages that wait for a mission, and what else is stored of its request."""

    stored: StoredDelivery
    pickup_position: Position
    give_up_at: datetime
    has_idempotency_key: bool = False
    #: The network of its pickup; None when the gateway does not know it.
    network_id: NetworkId | None = None
    #: Whether it has found no drone yet, or stands behind requests that have found none.
    is_waiting: bool = False
    #: Since when composition was asked and has not answered, wall time; None otherwise.
    asked_at: datetime | None = None
    #: When something last changed that may help it, wall time in ms since 1970.
    woken_wall_ms: int = 0

    @property
    def traceparent(self) -> str | None:
        """The traceparent of its request."""
        return self.stored.traceparent

    @property
    def delivery(self) -> Delivery:
        """The delivery, as it was when it was claimed."""
        return self.stored.delivery
