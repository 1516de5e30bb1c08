"""Deliveries as this process last wrote them, so that its next step need not read them first.

None of it is believed: whoever writes from it names its version, and where somebody has written
since, here or in another replica, nothing is written.
"""

from collections import OrderedDict
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime
from typing import Final

from skyway.geo import Position
from skyway.ids import DeliveryId
from skyway_gateway.deliveries.lifecycle.delivery import Delivery

#: The youngest of them, some seconds of a busy gateway's: most are booked and dispatched by then.
_MOST_KNOWN: Final = 500


class Outdated(Exception):
    """A delivery was written since it was read; it is to be read anew, under a lock."""


@dataclass(frozen=True, slots=True)
class Known:
    """A delivery as it was when its row had this version, and had told so many events.

    Its moments may be more exact than the milliseconds in which they are kept.
    """

    delivery: Delivery
    version: int
    last_sequence: int

    def then(self, delivery: Delivery, *, new_events: int) -> "Known":
        """What is known once this delivery has been written in its place."""
        return Known(delivery, self.version + 1, self.last_sequence + new_events)


class KnownDeliveries:
    """Remembers the youngest; what it has forgotten is read again."""

    def __init__(self) -> None:
        self._known: OrderedDict[DeliveryId, Known] = OrderedDict()

    def take(self, delivery_id: DeliveryId) -> Known | None:
        """A delivery as it was once, to write from; None when it is not remembered.

        It is forgotten until it has been written: whatever goes wrong, it is read the next time.
        """
        return self._known.pop(delivery_id, None)

    def among(self, wanted: Iterable[tuple[DeliveryId, int]]) -> dict[DeliveryId, Known]:
        """Those of these deliveries that are remembered just in this version."""
        pairs = ((self._known.get(delivery_id), version) for delivery_id, version in wanted)
        return {
            known.delivery.delivery_id: known
            for known, version in pairs
            if known is not None and known.version == version
        }

    def note(self, known: Known) -> None:
        """Remember what was just committed."""
        delivery = known.delivery
        before = self._known.pop(delivery.delivery_id, known)
        if any(mission.state == "REFUSED" for mission in delivery.missions):
            return  # who reads it again reads it without that mission
        self._known[delivery.delivery_id] = max(before, known, key=lambda one: one.version)
        if len(self._known) > _MOST_KNOWN:
            self._known.popitem(last=False)


@dataclass(frozen=True, slots=True)
class Queued:
    """A delivery with packages that wait, and what booking needs beside it."""

    known: Known
    pickup_position: Position
    give_up_at: datetime
    traceparent: str | None

    @property
    def delivery(self) -> Delivery:
        """The delivery, as it was when it was claimed."""
        return self.known.delivery
