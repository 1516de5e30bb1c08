"""The heartbeat of a drone that nothing happens to: seldom, and not with all others at once."""

from datetime import UTC, datetime, timedelta
from typing import Final
from zlib import crc32

from skyway.ids import DroneId
from skyway.runtime.clock import FleetClock, fleet_margin
from skyway_drone_agent.link.link_monitor import LinkMonitor

#: Wall seconds between two beats.
EVERY_S: Final = 30.0

#: Beats fall on whole multiples of so many wall seconds, counted from the epoch.
_TICK_S: Final = 1.0
_EPOCH: Final = datetime(1970, 1, 1, tzinfo=UTC)


class Heartbeat:
    """Says when a drone is due again; guard and state sender beat together.

    A fleet connects at once, after a start and when the broker comes back. Were all its drones due
    30 s later, and so for ever, whatever else happened then would wait for a second. So the first
    beat of a connection comes after a part of the time that is the drone's own.
    """

    def __init__(self, drone_id: DroneId, link: LinkMonitor, clock: FleetClock) -> None:
        self._share = crc32(drone_id.encode()) / 2**32
        self._link = link
        self._clock = clock

    def after(self, moment: datetime) -> datetime:
        """When a drone is due that was looked at or sent its state then."""
        every, tick = self._wall(EVERY_S), self._wall(_TICK_S)
        if self._link.up_since is not None:
            first = _at_tick(self._link.up_since + self._share * every, tick)
            if moment < first:
                return min(first, moment + every)
        return _at_tick(moment + every, tick)

    def _wall(self, seconds: float) -> timedelta:
        return fleet_margin(self._clock, fleet_s=0.0, wall_s=seconds)


def _at_tick(moment: datetime, tick: timedelta) -> datetime:
    """A few dozen drones together take half the processor time of as many one by one."""
    return moment - (moment - _EPOCH) % tick
