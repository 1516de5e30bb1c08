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


async def wait_for_end_or_news(performing: asyncio.Future[Any], news: asyncio.Event) -> None:
    """Return when that is done, or when there is news, which is then taken as read."""
    hearing = asyncio.ensure_future(news.wait())
    try:
        await asyncio.wait((performing, hearing), return_when=asyncio.FIRST_COMPLETED)
    finally:
        hearing.cancel()
    news.clear()
