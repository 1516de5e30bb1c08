"""An answer of server-sent events; it uses one of its reader's slots while it is open."""

from collections.abc import AsyncIterable
from contextlib import AbstractAsyncContextManager
from typing import Final

from fastapi.responses import StreamingResponse
from starlette.types import Receive, Scope, Send

from skyway.runtime.http.loop_time import charged
from skyway.runtime.limits import Slots

_HEADERS: Final = {"Cache-Control": "no-store", "X-Accel-Buffering": "no"}

#: Opens the chunks that the stream sends, for as long as the stream is open.
Frames = AbstractAsyncContextManager[AsyncIterable[str | bytes]]


class EventStreamAnswer(StreamingResponse):
    """A stream of server-sent events."""

    def __init__(self, frames: Frames, *, slots: Slots, who: str) -> None:
        super().__init__((), media_type="text/event-stream", headers=_HEADERS)
        self._frames = frames
        self._slots = slots
        self._who = who
        self._scope: Scope = {}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send the stream.

        Raises
        ------
        BudgetSpent
            All streams that the reader may have are open.
        """
        with self._slots.held(self._who):
            async with self._frames as frames:
                self.body_iterator, self._scope = frames, scope
                await super().__call__(scope, receive, send)

    async def stream_response(self, send: Send) -> None:
        """Send the frames; Starlette does this in a task of its own."""
        await charged(self._scope, super().stream_response(send))
