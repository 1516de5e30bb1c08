"""The heartbeat of an idle drone: rare, and spread over the drones of a fleet."""

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
    """Says when a drone is due again; guard and state sender use the same moments.

    All drones of a fleet connect together, after a start and when the broker comes back. If all
    were due 30 s later and every 30 s after that, other work would wait for a second each time. So
    each drone has its own delay before the first beat of a connection.
    """

    def __init__(self, drone_id: DroneId, link: LinkMonitor, clock: FleetClock) -> None:
        self._share = crc32(drone_id.encode()) / 2**32
        self._link = link
        self._clock = clock

    def after(self, moment: datetime) -> datetime:
        """When a drone is due that was last looked at, or sent its state, at the moment."""
        every, tick = self._wall(EVERY_S), self._wall(_TICK_S)
        if self._link.up_since is not None:
            first = _at_tick(self._link.up_since + self._share * every, tick)
            if moment < first:
                return min(first, moment + every)
        return _at_tick(moment + every, tick)

    def _wall(self, seconds: float) -> timedelta:
        return fleet_margin(self._clock, fleet_s=0.0, wall_s=seconds)


def _at_tick(moment: datetime, tick: timedelta) -> datetime:
    """The moment rounded down to a tick: drones that wake together take half the CPU time."""
    return moment - (moment - _EPOCH) % tick
