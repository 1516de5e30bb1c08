"""Waiting for news or for a moment of fleet time, whichever comes first."""

import asyncio
from collections.abc import Coroutine
from datetime import datetime
from typing import Any, Self, TypeVar

from skyway.runtime.clock import FleetClock, sleep_wall

T = TypeVar("T")


class NewsOrMoment:
    """Waits repeatedly, while the block lasts, for news or for a moment of fleet time.

    One task sleeps through all the waits, because news comes often and then the moment moves on. A
    task for each wait took a tenth of a fleet's processor time.
    """

    def __init__(self, news: asyncio.Event, clock: FleetClock) -> None:
        self._news = news
        self._clock = clock
        #: The moment that is waited for; None without one and while nobody waits.
        self._moment: datetime | None = None
        self._sleeping: asyncio.Task[None] | None = None
        self._sleeps_until: datetime | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._wake()

    async def wait(self, *, until: datetime | None) -> None:
        """Return when there is news, which is then cleared, or when the moment has come."""
        self._moment = until
        if until is not None and not self._is_woken_by(until):
            self._wake()
            self._sleeps_until = until
            self._sleeping = asyncio.ensure_future(self._sleep())
            self._sleeping.add_done_callback(self._has_come)
        await self._news.wait()
        self._news.clear()
        self._moment = None
        if self._sleeping is not None and self._sleeping.done():
            self._sleeping.result()

    def _is_woken_by(self, moment: datetime) -> bool:
        """Whether the current sleep ends at that moment or earlier."""
        is_asleep = self._sleeping is not None and not self._sleeping.done()
        return is_asleep and self._sleeps_until is not None and self._sleeps_until <= moment

    async def _sleep(self) -> None:
        while self._sleeps_until is not None:
            await self._clock.sleep_until(self._sleeps_until)
            if self._moment is None or self._moment <= self._sleeps_until:
                return
            self._sleeps_until = self._moment

    def _has_come(self, slept: "asyncio.Task[None]") -> None:
        """Treat the moment as news, so that `wait` waits for one event only."""
        if self._moment is not None and slept is self._sleeping:
            self._news.set()

    def _wake(self) -> None:
        if self._sleeping is not None:
            self._sleeping.cancel()
            self._sleeping = None


async def wait_for_end_or_news(performing: asyncio.Future[Any], news: asyncio.Event) -> None:
    """Return when the step is done, or when there is news, which is then cleared."""
    receiving = asyncio.ensure_future(news.wait())
    try:
        await asyncio.wait((performing, receiving), return_when=asyncio.FIRST_COMPLETED)
    finally:
        receiving.cancel()
    news.clear()


async def finished_within(
    clock: FleetClock, wall_s: float | None, work: Coroutine[Any, Any, T]
) -> T | None:
    """The result of the work; None when it takes longer than so many seconds of wall time.

    The clock measures the time, so that tests can move it. Without `wall_s` there is no limit.
    """
    if wall_s is None:
        return await work
    working, alarm = asyncio.ensure_future(work), asyncio.ensure_future(sleep_wall(clock, wall_s))
    try:
        await asyncio.wait((working, alarm), return_when=asyncio.FIRST_COMPLETED)
        return working.result() if working.done() else None
    finally:
        working.cancel()
        alarm.cancel()
