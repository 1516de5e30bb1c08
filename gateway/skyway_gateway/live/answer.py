"""An answer that streams a view to one viewer."""

from typing import Final

from fastapi.responses import StreamingResponse
from starlette.types import Receive, Send
from starlette.types import Scope as AsgiScope

from skyway.runtime.slots import Slots
from skyway_gateway.live.scope import Scope
from skyway_gateway.live.viewer_frames import ViewerFrames

_SSE_HEADERS: Final = {"Cache-Control": "no-store", "X-Accel-Buffering": "no"}


class LiveAnswer(StreamingResponse):
    """The stream of a viewer, who takes a slot and counts as looking while it is open."""

    def __init__(self, frames: ViewerFrames, *, scope: Scope, slots: Slots, who: str) -> None:
        super().__init__((), media_type="text/event-stream", headers=_SSE_HEADERS)
        self._frames = frames
        self._scope = scope
        self._slots = slots
        self._who = who

    async def __call__(self, scope: AsgiScope, receive: Receive, send: Send) -> None:
        """Send the stream.

        Raises
        ------
        BudgetSpent
            STREAMS: the viewer has as many open as it may have.
        ServiceUnavailable
            Registry or composition have not answered yet.
        """
        with self._slots.held(self._who):
            async with self._frames.feed.viewing(self._scope) as view:
                self.body_iterator = self._frames.of(view)
                await super().__call__(scope, receive, send)
