"""How often a piece of work may begin that many callers ask for together."""

import asyncio
from datetime import datetime, timedelta

from skyway.runtime.clock import AnchoredClock, FleetClock, sleep_wall

_NO_TIME = timedelta(0)


class Pace:
    """Lets a turn begin at most every `every_s` seconds of wall time; the first one immediately.

    With `burst`, so many unused turns may be used later, at least `least_s` apart. The clock
    measures the time, so that tests can move it; without one it is the machine's clock.
    """

    def __init__(
        self,
        every_s: float = 0.0,
        *,
        burst: int = 0,
        least_s: float = 0.0,
        clock: FleetClock | None = None,
    ) -> None:
        self._clock = AnchoredClock.plain() if clock is None else clock
        self._every = timedelta(seconds=every_s)
        self._ahead = burst * self._every
        self._least = timedelta(seconds=least_s)
        self._began_at: datetime | None = None
        self._due_at: datetime | None = None  # when the next turn would begin, had none come early

    async def turn(self) -> None:
        """Wait until the next turn may begin; one caller waits at a time."""
        wait_s = self._wait_s(self._clock.wall_now())
        if wait_s > 0.0:
            await sleep_wall(self._clock, wait_s)
        else:
            # Callers that are ready now join this turn.
            await asyncio.sleep(0)
        self._began_at = now = self._clock.wall_now()
        self._due_at = (now if self._due_at is None else max(self._due_at, now)) + self._every

    def _wait_s(self, now: datetime) -> float:
        if self._began_at is None or self._due_at is None:
            return 0.0
        if now < self._began_at:
            # The wall clock was set back, so earlier moments cannot be compared with it.
            self._began_at = self._due_at = now
        earliest_at = max(self._due_at - self._ahead, self._began_at + self._least)
        return max(_NO_TIME, earliest_at - now).total_seconds()
