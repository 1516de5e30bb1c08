"""Work that only its caller wants ends when the caller leaves.

For calls that change nothing, or whose change is another service's to finish: what changes
something here goes on, so that the caller who comes back finds it done.
"""

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

from fastapi import Request
from starlette.requests import ClientDisconnect
from starlette.types import Message

T = TypeVar("T")


async def while_wanted(
    request: Request,
    answer: Callable[[Request], Coroutine[Any, Any, T]],  # Any: what it yields is asyncio's
) -> T:
    """What `answer` makes of the request; cancelled if the client leaves.

    The request's body has not been read before, or has none.

    Raises
    ------
    ClientDisconnect
        The client left first.
    """
    watched = _Watched(request)
    working = asyncio.create_task(answer(watched.request))
    leaving = asyncio.create_task(watched.has_left())
    try:
        await asyncio.wait({working, leaving}, return_when=asyncio.FIRST_COMPLETED)
        if not working.done():
            raise ClientDisconnect
        return working.result()
    finally:
        working.cancel()
        leaving.cancel()
        await asyncio.wait({working, leaving})


class _Watched:
    """A request that notices when its body has been read: only then may others receive."""

    def __init__(self, request: Request) -> None:
        self.request = Request(request.scope, self._receive)
        self._given = request
        self._is_read = asyncio.Event()

    async def has_left(self) -> None:
        """Return when the client has left."""
        await self._is_read.wait()
        while (await self._given.receive())["type"] != "http.disconnect":
            pass

    async def _receive(self) -> Message:
        message = await self._given.receive()
        if message["type"] == "http.request" and not message.get("more_body", False):
            self._is_read.set()
        return message
