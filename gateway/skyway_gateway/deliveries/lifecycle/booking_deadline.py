"""Until when a request that nobody can fly yet stays in the queue."""

from datetime import datetime
from typing import Final

from skyway.delivery.request import DeliveryRequest
from skyway.runtime.clock import FleetClock, fleet_margin

#: How long a request without a deadline waits, fleet and wall seconds (docs/reference/time.md).
_BUSY_FLEET_S: Final = 3600.0
_BUSY_WALL_S: Final = 60.0


def give_up_at(request: DeliveryRequest, clock: FleetClock) -> datetime:
    """Its deadline, or a while from now, or from when it may be picked up."""
    if request.qos.deadline_at is not None:
        return request.qos.deadline_at
    now = clock.now()
    patience = fleet_margin(clock, fleet_s=_BUSY_FLEET_S, wall_s=_BUSY_WALL_S)
    return max(now, request.earliest_pickup_at or now) + patience
