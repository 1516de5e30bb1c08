"""An answer of server-sent events; it uses one of its reader's slots while it is open."""

from collections.abc import AsyncIterable
from contextlib import AbstractAsyncContextManager, suppress
from typing import Final

from fastapi.responses import StreamingResponse
from starlette.requests import ClientDisconnect
from starlette.types import Receive, Scope, Send

from skyway.runtime.http.client_disconnect import before
from skyway.runtime.http.loop_time import charged
from skyway.runtime.limits import Slots

_HEADERS: Final = {"Cache-Control": "no-store", "X-Accel-Buffering": "no"}

#: Opens the chunks that the stream sends, for as long as the stream is open.
Frames = AbstractAsyncContextManager[AsyncIterable[str | bytes]]


class EventStreamAnswer(StreamingResponse):
    """A stream of server-sent events.

    Starlette would end a stream by an error that refers to itself, and so leaves some hundred
    objects to the garbage collector, which stops the event loop.
    """

    def __init__(self, frames: Frames, *, slots: Slots, who: str) -> None:
        super().__init__((), media_type="text/event-stream", headers=_HEADERS)
        self._frames = frames
        self._slots = slots
        self._who = who

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send the stream.

        Raises
        ------
        BudgetSpent
            All streams that the reader may have are open.
        """
        with self._slots.held(self._who):
            async with self._frames as frames:
                self.body_iterator = frames
                sending = charged(scope, self.stream_response(send))
                with suppress(ClientDisconnect):
                    await before(self.listen_for_disconnect(receive), sending)
