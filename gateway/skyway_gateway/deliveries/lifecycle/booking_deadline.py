"""How long packages wait for a mission before booking gives them up."""

from datetime import datetime
from typing import Final

from skyway.delivery.request import DeliveryRequest
from skyway.runtime.clock import FleetClock, fleet_margin

#: How long a request without a deadline waits, fleet and wall seconds (docs/reference/time.md).
_BUSY_FLEET_S: Final = 3600.0
_BUSY_WALL_S: Final = 60.0


def give_up_at(request: DeliveryRequest, clock: FleetClock) -> datetime:
    """The request's deadline; without one, an hour after now or after the earliest pickup.

    The hour is fleet time, and at least a minute of wall time.
    """
    if request.qos.deadline_at is not None:
        return request.qos.deadline_at
    now = clock.now()
    margin = fleet_margin(clock, fleet_s=_BUSY_FLEET_S, wall_s=_BUSY_WALL_S)
    return max(now, request.earliest_pickup_at or now) + margin
