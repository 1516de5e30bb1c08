"""Whether the cloud is heard behind the broker: its clock comes again and again."""

from collections.abc import Callable
from datetime import datetime, timedelta

from skyway.runtime.clock import FleetClock
from skyway_drone_agent.link.uplink import Link

#: Three of the gateway's repetitions (wall time).
SILENT_AFTER = timedelta(seconds=90)


class CloudWatch:
    """Remembers when something last came from the cloud.

    A cloud that has never repeated its clock is not expected to: the retained clock comes from
    the broker, whether the cloud lives or not.
    """

    def __init__(self, link: Link, clock: FleetClock, *, on_change: Callable[[], None]) -> None:
        self._link = link
        self._clock = clock
        self._on_change = on_change
        self._repeats = False
        self._heard_at_wall = clock.wall_now()
        self._heard_again_at = clock.now()

    @property
    def not_silent_since(self) -> datetime | None:
        """The fleet moment when the cloud was last heard again; None while it is silent."""
        return None if self.is_silent else self._heard_again_at

    @property
    def is_silent(self) -> bool:
        """Whether the link is up and nothing has come for long."""
        if not self._repeats or not self._link.is_connected:
            return False
        return self._clock.wall_now() - self._heard_at_wall >= SILENT_AFTER

    def heard_clock(self, *, is_repeated: bool) -> None:
        """Note that the clock has come, from the cloud itself when it `is_repeated`."""
        if is_repeated:
            self._repeats = True
            self.heard()

    def heard(self) -> None:
        """Note that something has come from the cloud, or may come again from now on."""
        was_silent = self.is_silent
        self._heard_at_wall = self._clock.wall_now()
        if was_silent:
            self._heard_again_at = self._clock.now()
            self._on_change()
