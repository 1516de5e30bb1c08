"""Waiting for whichever comes first: news, or a moment of fleet time."""

import asyncio
from datetime import datetime

from skyway.runtime.clock import FleetClock


async def wait_for_news(news: asyncio.Event, clock: FleetClock, *, until: datetime | None) -> None:
    """Return when there is news, which is then taken as read, or when the moment has come."""
    if until is None:
        await news.wait()
    else:
        waits = [
            asyncio.ensure_future(news.wait()),
            asyncio.ensure_future(clock.sleep_until(until)),
        ]
        try:
            await asyncio.wait(waits, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for wait in waits:
                wait.cancel()
    news.clear()
