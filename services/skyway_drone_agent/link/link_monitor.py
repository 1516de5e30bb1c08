"""Whether the link to the broker is up, and whether the cloud behind the broker sends."""

from collections.abc import Callable
from datetime import datetime, timedelta

from skyway.runtime.clock import FleetClock
from skyway_drone_agent.link.uplink import Link

#: A link counts as lost after this wall time: the drone then waits at its next landing.
LINK_LOST_AFTER = timedelta(seconds=10)


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


#: Three times the interval at which the gateway repeats its clock (wall time).
SILENT_AFTER = timedelta(seconds=90)


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
