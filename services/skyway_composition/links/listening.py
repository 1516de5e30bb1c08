"""Since when this process has received and handled every message of drones.

A drone's silence proves something only to a process that has listened all the time. A process that
was started later, lost its connection, was frozen or dropped messages may have missed an answer.
"""

from datetime import datetime, timedelta
from typing import Final

from skyway.runtime.clock import FleetClock

#: A longer pause between two looks at the clock means that this process was frozen. Wall time.
_LONGEST_PAUSE: Final = timedelta(seconds=5)


class Listening:
    """The span for which no message of a drone was missed, in fleet time."""

    def __init__(self, clock: FleetClock) -> None:
        self._clock = clock
        self._since_at: datetime | None = None
        self._busy_since_at: datetime | None = None
        self._looked_wall_at: datetime | None = None

    def begin(self) -> None:
        """Everything before this moment may have been missed; from now on nothing is."""
        self._since_at = self._clock.now()

    def end(self) -> None:
        """Messages are missed from now on, until `begin`."""
        self._since_at = None

    def begin_batch(self) -> None:
        """Messages are being handled; they count as handled at `end_batch`."""
        self._busy_since_at = self._busy_since_at or self._clock.now()

    def end_batch(self) -> None:
        """All messages that had arrived before the last `begin_batch` are handled."""
        self._busy_since_at = None

    def look(self) -> None:
        """Notice a freeze of this process; must be called every second of wall time."""
        wall_at = self._clock.wall_now()
        last = self._looked_wall_at
        if self._since_at is not None and last is not None and wall_at - last > _LONGEST_PAUSE:
            self.begin()
        self._looked_wall_at = wall_at

    def covers(self, from_at: datetime, until_at: datetime) -> bool:
        """Whether every message between these moments was received here and is handled."""
        if self._since_at is None or self._since_at > from_at:
            return False
        return self._busy_since_at is None or self._busy_since_at > until_at
