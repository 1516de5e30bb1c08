"""Reads one large problem at a time: a thread that reads cannot be stopped by its caller."""

import asyncio
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")
A = TypeVar("A")


class ReadingTurn:
    """Runs functions in a thread, one after another; a caller that leaves gives up its place."""

    def __init__(self) -> None:
        self._turn = asyncio.Semaphore(1)

    async def run(self, read: Callable[[A], T], value: A) -> T:
        """What `read` makes of the value."""
        async with self._turn:
            reading = asyncio.ensure_future(asyncio.to_thread(read, value))
            try:
                return await asyncio.shield(reading)
            except asyncio.CancelledError:
                # The next one begins when the thread is free.
                await asyncio.wait({reading})
                raise
