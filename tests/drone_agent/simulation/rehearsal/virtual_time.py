"""Virtual time: an event loop that moves the clock whenever it has nothing else to do."""

import asyncio
import heapq
import selectors
from collections.abc import Coroutine
from datetime import UTC, datetime, timedelta
from typing import Any

from skyway.contracts.world import ClockAnchor

START = datetime(2026, 3, 1, 12, tzinfo=UTC)


class NothingIsWaitedFor(Exception):
    """No task can ever continue."""


class VirtualClock:
    """Fleet time that jumps from one sleeper to the next; the wall's passes `rate` times slower."""

    def __init__(self, rate: float) -> None:
        self.rate = rate
        self._now = self._wall = START
        self._sleepers: list[tuple[datetime, int, asyncio.Future[None]]] = []
        self._slept = 0
        #: When the agent saw nothing for a while.
        self.absences: list[datetime] = []

    def now(self) -> datetime:
        return self._now

    def wall_now(self) -> datetime:
        return self._wall

    @property
    def elapsed_s(self) -> float:
        """Fleet seconds since the story began."""
        return (self._now - START).total_seconds()

    def keep(self, anchor: ClockAnchor) -> None:
        """The story alone moves time."""

    async def wait_until_set(self) -> None:
        return

    async def sleep_until(self, fleet_moment: datetime) -> None:
        if fleet_moment <= self._now:
            return
        awake: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._slept += 1
        heapq.heappush(self._sleepers, (fleet_moment, self._slept, awake))
        await awake

    async def sleep(self, fleet_s: float) -> None:
        await self.sleep_until(self._now + timedelta(seconds=fleet_s))

    async def sleep_wall(self, wall_s: float) -> None:
        await self.sleep(wall_s * self.rate)

    def wake_next(self) -> None:
        """Move on to the next moment that somebody waits for, and wake them."""
        while self._sleepers:
            moment, _, awake = heapq.heappop(self._sleepers)
            if not awake.done():
                self._pass(max(timedelta(0), moment - self._now))
                awake.set_result(None)
                return
        raise NothingIsWaitedFor

    def note_absence(self) -> None:
        """Note that the agent is absent from now on for a while."""
        self.absences.append(self._now)

    def jump(self, by_s: float) -> None:
        """Set the fleet clock forward; the wall clock stays."""
        self.note_absence()
        self._now += timedelta(seconds=by_s)

    def stand_still(self, by_s: float) -> None:
        """Nothing runs for so long, as when a computer sleeps."""
        self.note_absence()
        self._pass(timedelta(seconds=by_s))

    def set_wall(self, by_s: float) -> None:
        """The wall clock is set, for instance back by an hour."""
        self._wall += timedelta(seconds=by_s)

    def _pass(self, by: timedelta) -> None:
        self._now += by
        self._wall += by / self.rate


class _IdleSelector(selectors.SelectSelector):
    """A selector without sockets; when all tasks wait, time passes."""

    def __init__(self, clock: VirtualClock) -> None:
        super().__init__()
        self._clock = clock

    def select(self, timeout: float | None = None) -> list[Any]:
        if timeout is None:
            self._clock.wake_next()
        return []


def run_in(clock: VirtualClock, story: Coroutine[Any, Any, None]) -> None:
    """Run the story to its end."""
    loop = asyncio.SelectorEventLoop(_IdleSelector(clock))
    with asyncio.Runner(loop_factory=lambda: loop) as runner:
        runner.run(story)
