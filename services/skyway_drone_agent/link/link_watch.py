"""Whether the link to the cloud is up, and whether it has been down for too long."""

from collections.abc import Callable
from datetime import datetime, timedelta

from skyway.runtime.clock import FleetClock
from skyway_drone_agent.link.uplink import Link

#: A link that is down for so long counts as lost: the drone waits at the next landing (wall time).
LINK_LOST_AFTER = timedelta(seconds=10)


class LinkWatch:
    """Remembers when the link went and came."""

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
        """The fleet moment when the link was last found again; None while it is lost."""
        return None if self._is_lost() else self._found_again_at

    def came_up(self) -> None:
        """Note a new connection."""
        self._up_since = self._clock.now()
        if self._is_lost():
            self._found_again_at = self._up_since
        self._down_since_wall = None
        self._on_change()

    async def run(self) -> None:
        """Note for ever when the connection is lost."""
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
