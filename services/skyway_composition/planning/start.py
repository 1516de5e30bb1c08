"""When a mission that is planned now begins."""

from datetime import datetime

from skyway.runtime.clock import FleetClock, fleet_margin
from skyway.units import moment_to_ms


def start_ms(clock: FleetClock, *, earliest_at: datetime | None, patience: int = 1) -> int:
    """The millisecond at which a mission begins: late enough to plan it and reach the drone.

    `patience` is how many times the usual margin that takes.
    """
    start_at = clock.now() + fleet_margin(clock, fleet_s=60, wall_s=2) * patience
    if earliest_at is not None:
        start_at = max(start_at, earliest_at)
    return moment_to_ms(start_at) + 1
