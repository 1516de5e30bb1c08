"""Waiting for whichever comes first: news, or a moment of fleet time."""

import asyncio
from datetime import datetime
from typing import Any

from skyway.runtime.clock import FleetClock


async def wait_for_news(news: asyncio.Event, clock: FleetClock, *, until: datetime | None) -> None:
    """Return when there is news, which is then taken as read, or when the moment has come."""
    if until is None:
        await news.wait()
    else:
        await _wait_until(until, news, clock)
    news.clear()


async def _wait_until(moment: datetime, news: asyncio.Event, clock: FleetClock) -> None:
    """The moment is news too: one task less than to wait for either, which a fleet does often."""

    def has_come(_: asyncio.Future[None]) -> None:
        news.set()

    sleeping = asyncio.ensure_future(clock.sleep_until(moment))
    sleeping.add_done_callback(has_come)
    try:
        await news.wait()
        if sleeping.done():
            sleeping.result()
    finally:
        sleeping.remove_done_callback(has_come)
        sleeping.cancel()


async def wait_for_end_or_news(performing: asyncio.Future[Any], news: asyncio.Event) -> None:
    """Return when that is done, or when there is news, which is then taken as read."""
    hearing = asyncio.ensure_future(news.wait())
    try:
        await asyncio.wait((performing, hearing), return_when=asyncio.FIRST_COMPLETED)
    finally:
        hearing.cancel()
    news.clear()
