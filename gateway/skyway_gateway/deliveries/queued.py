"""A delivery in the queue of those to be booked."""

from dataclasses import dataclass
from datetime import datetime

from skyway.geo import Position
from skyway_gateway.deliveries.delivery import Delivery
from skyway_gateway.deliveries.known import Known


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
