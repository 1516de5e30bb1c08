"""Changes that a test waits for."""

import asyncio
from collections.abc import Callable


class Changes:
    """Lets a test wait until something it looks at is so."""

    def __init__(self) -> None:
        self._changed = asyncio.Event()

    def notify(self) -> None:
        self._changed.set()
        self._changed = asyncio.Event()

    async def until(self, is_so: Callable[[], bool]) -> None:
        async with asyncio.timeout(60):
            while not is_so():
                await self._changed.wait()
