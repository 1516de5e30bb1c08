"""Whether the link to the broker is up, whether the cloud behind it sends, and the heartbeat."""

from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from typing import Final
from zlib import crc32

from skyway.ids import DroneId
from skyway.runtime.clock import FleetClock, fleet_margin
from skyway_drone_agent.link.uplink import Link

#: A link counts as lost after this wall time: the drone then waits at its next landing.
LINK_LOST_AFTER = timedelta(seconds=10)

#: Three times the interval at which the gateway repeats its clock (wall time).
SILENT_AFTER = timedelta(seconds=90)

#: Wall seconds between two beats of the heartbeat.
HEARTBEAT_EVERY_S: Final = 30.0

#: Beats fall on whole multiples of so many wall seconds, counted from the epoch.
_TICK_S: Final = 1.0

_EPOCH: Final = datetime(1970, 1, 1, tzinfo=UTC)


class LinkMonitor:
    """Remembers when the link went down and came up."""

    def __init__(self, link: Link, clock: FleetClock, *, on_change: Callable[[], None]) -> None:
        self._link = link
        self._clock = clock
        self._on_change = on_change
        self._down_since_wall = None if link.is_connected else clock.wall_now()
        self._up_since = clock.now()
        self._found_again_at = clock.now()

    @property
    def up_since(self) -> datetime | None:
        """The fleet moment of the last connect; None while the link is down."""
        return self._up_since if self._down_since_wall is None else None

    @property
    def not_lost_since(self) -> datetime | None:
        """The fleet moment since when the link is not lost; None while it is lost."""
        return None if self._is_lost() else self._found_again_at

    def came_up(self) -> None:
        """Note a new connection."""
        self._up_since = self._clock.now()
        if self._is_lost():
            self._found_again_at = self._up_since
        self._down_since_wall = None
        self._on_change()

    async def run(self) -> None:
        """Note each loss of the connection, for ever."""
        while True:
            await self._link.wait_connected()
            await self._link.wait_lost()
            if self._down_since_wall is None:
                self._down_since_wall = self._clock.wall_now()
                self._on_change()

    def _is_lost(self) -> bool:
        if self._down_since_wall is None:
            return False
        return self._clock.wall_now() - self._down_since_wall >= LINK_LOST_AFTER


class CloudMonitor:
    """Remembers when the last message came from the cloud.

    A cloud that has never repeated its clock is never silent: the broker sends the retained clock
    even when the cloud does not run.
    """

    def __init__(self, link: Link, clock: FleetClock, *, on_change: Callable[[], None]) -> None:
        self._link = link
        self._clock = clock
        self._on_change = on_change
        self._repeats = False
        self._last_message_wall_at = clock.wall_now()
        self._back_since = clock.now()

    @property
    def not_silent_since(self) -> datetime | None:
        """The fleet moment since when the cloud is not silent; None while it is silent."""
        return None if self.is_silent else self._back_since

    @property
    def is_silent(self) -> bool:
        """Whether the link is up and no message has come for long."""
        if not self._repeats or not self._link.is_connected:
            return False
        return self._clock.wall_now() - self._last_message_wall_at >= SILENT_AFTER

    def note_clock(self, *, is_repeated: bool) -> None:
        """Note that the clock arrived; if it `is_repeated`, the cloud itself has sent it."""
        if is_repeated:
            self._repeats = True
            self.note_message()

    def note_message(self) -> None:
        """Note a message of the cloud, or a new connection on which messages can arrive."""
        was_silent = self.is_silent
        self._last_message_wall_at = self._clock.wall_now()
        if was_silent:
            self._back_since = self._clock.now()
            self._on_change()


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
        """When a drone is due again that was last looked at, or sent its state, at this moment."""
        every, tick = self._wall(HEARTBEAT_EVERY_S), self._wall(_TICK_S)
        if self._link.up_since is not None:
            first = at_tick(self._link.up_since + self._share * every, tick)
            if moment < first:
                return min(first, moment + every)
        return at_tick(moment + every, tick)

    def _wall(self, seconds: float) -> timedelta:
        return fleet_margin(self._clock, fleet_s=0.0, wall_s=seconds)


def at_tick(moment: datetime, tick: timedelta) -> datetime:
    """The moment rounded down to a tick: drones that wake together take half the CPU time."""
    return moment - (moment - _EPOCH) % tick
