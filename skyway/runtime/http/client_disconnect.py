"""Work that ends when its client disconnects.

For calls that change nothing, or whose change another service completes. A call that changes
something here goes on: a client that asks again finds it done.
"""

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any, Final, TypeVar

from fastapi import Request
from starlette.requests import ClientDisconnect
from starlette.types import Message

from skyway.runtime.http.loop_time import charged

T = TypeVar("T")

#: The ASGI extension in which the server says whether a client has closed the connection.
CALLER_GONE: Final = "skyway.caller_gone"


async def cancel_on_disconnect(
    request: Request,
    answer: Callable[[Request], Coroutine[Any, Any, T]],  # Any: what it yields is asyncio's
) -> T:
    """The result of `answer` for the request; it is cancelled if the client disconnects.

    The request's body has not been read before, or there is none.

    Raises
    ------
    ClientDisconnect
        The client disconnected first.
    """
    watched = _WatchedRequest(request)
    return await before(watched.disconnected(), charged(request.scope, answer(watched.request)))


async def before(
    disconnected: Coroutine[Any, Any, None],
    work: Coroutine[Any, Any, T],  # Any: what it yields is asyncio's
) -> T:
    """The result of the work; it is cancelled if the client has disconnected before.

    Raises
    ------
    ClientDisconnect
        The client disconnected first.
    """
    working, leaving = asyncio.create_task(work), asyncio.create_task(disconnected)
    try:
        await asyncio.wait({working, leaving}, return_when=asyncio.FIRST_COMPLETED)
        if not working.done():
            raise ClientDisconnect
        return working.result()
    finally:
        working.cancel()
        leaving.cancel()
        await asyncio.wait({working, leaving})


def refuse_gone(request: Request) -> None:
    """Raise ClientDisconnect if the server knows, without reading, that the client is gone.

    Raises
    ------
    ClientDisconnect
        The client has closed the connection.
    """
    extension = request.scope.get("extensions", {}).get(CALLER_GONE)
    if extension is not None and extension["is_gone"]():
        raise ClientDisconnect


class _WatchedRequest:
    """A request that notices when its body has been read. Only after that may others receive."""

    def __init__(self, request: Request) -> None:
        self.request = Request(request.scope, self._receive)
        self._original = request
        self._is_read = asyncio.Event()

    async def disconnected(self) -> None:
        """Return when the client has disconnected."""
        await self._is_read.wait()
        while (await self._original.receive())["type"] != "http.disconnect":
            pass

    async def _receive(self) -> Message:
        message = await self._original.receive()
        if message["type"] == "http.request" and not message.get("more_body", False):
            self._is_read.set()
        return message
