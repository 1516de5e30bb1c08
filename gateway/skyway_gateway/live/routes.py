"""GET /v1/live: the live picture as server-sent events."""

import asyncio
import re
from collections.abc import AsyncGenerator, Awaitable, Callable
from dataclasses import dataclass
from typing import Annotated, Final

from fastapi import Depends, Header, Query, Request, Response
from fastapi.responses import StreamingResponse
from pydantic import Field
from starlette.types import Receive, Send
from starlette.types import Scope as AsgiScope

from skyway.json_model import JsonModel
from skyway.runtime.http.identity import Caller
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.slots import Slots
from skyway_gateway.access.routes import KeyGate
from skyway_gateway.live.feed import LiveFeed
from skyway_gateway.live.scope import Scope
from skyway_gateway.live.view import TooSlow, View

_SSE_HEADERS: Final = {"Cache-Control": "no-store", "X-Accel-Buffering": "no"}
_HEARTBEAT: Final = b": still here\n\n"
#: Wall seconds: between two looks at whether the key is still in use, and of silence.
_CHECK_S: Final = 0.4
_HEARTBEAT_S: Final = 15.0
_EVENT_ID: Final = re.compile(r"([0-9a-f]{8})-([0-9]{1,15})")

MayRead = Callable[[], Awaitable[bool]]


class LiveQuery(JsonModel):
    """The part of the picture that is asked for."""

    kinds: Annotated[
        str | None,
        Field(
            max_length=200,
            description="Only these kinds, with commas between them: drones, missions, stations, "
            "closures, alarms, deliveries, services. All kinds without it.",
            examples=["drones,missions"],
        ),
    ] = None
    bbox: Annotated[
        str | None,
        Field(
            max_length=200,
            description="Only what is in this area: west,south,east,north in degrees. Alarms, "
            "deliveries and closures without an area are always shown.",
            examples=["-98.6,29.3,-97.8,30.0"],
        ),
    ] = None


def live_routes(*, gate: KeyGate, feed: LiveFeed, slots: Slots) -> ServiceRouter:
    """GET /v1/live."""
    router = ServiceRouter(tags=("live",))

    @router.get(
        "/v1/live",
        response_class=StreamingResponse,
        responses={200: {"content": {"text/event-stream": {"schema": {"type": "string"}}}}},
    )
    async def stream_live_picture(
        request: Request,
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[LiveQuery, Query()],
        last_event_id: Annotated[str | None, Header(max_length=64)] = None,
    ) -> Response:
        """Follow the fleet as it is now: first all of it, then what changes.

        The first event, `snapshot`, is an object of the kinds, each an object of items by id. Each
        later event, `change`, is a merge patch (RFC 7396) of that object. A viewer who comes back
        with `Last-Event-ID` within a minute goes on where it was, others get another snapshot.
        Operators see everything, a provider its own drones and missions, a customer its own
        deliveries and the drones that carry its packages.

        Callers: customer, provider, operator.
        """
        caller.must_be("customer", "provider", "operator")
        scope = Scope.of(caller, kinds=query.kinds, bbox=query.bbox)
        frames = _Frames(feed, _number_in(last_event_id), request.state.is_still_known)
        return _LiveAnswer(frames, scope=scope, slots=slots, who=str(caller))

    return router


def _number_in(last_event_id: str | None) -> tuple[str, int] | None:
    """The epoch and the number of the last event; None when the text is of another stream."""
    found = _EVENT_ID.fullmatch(last_event_id or "")
    return None if found is None else (found[1], int(found[2]))


@dataclass(frozen=True, slots=True)
class _Frames:
    """The events of one viewer."""

    feed: LiveFeed
    last_seen: tuple[str, int] | None
    may_read: MayRead

    async def of(self, view: View) -> AsyncGenerator[bytes]:
        """A snapshot or what was missed, then changes; the end for a viewer who is too slow."""
        picture, loop = self.feed.picture, asyncio.get_running_loop()
        if self.last_seen and view.can_resume(*self.last_seen, latest=picture.number):
            number = self.last_seen[1]
        else:
            snapshot = view.snapshot(picture)
            number = snapshot.number
            yield snapshot.content
        spoken_at = loop.time()
        while await self.may_read():
            changed = view.changed
            try:
                frames = view.frames_after(number)
            except TooSlow:
                return
            for frame in frames:
                yield frame.content
                number, spoken_at = frame.number, loop.time()
            if loop.time() - spoken_at >= _HEARTBEAT_S:
                yield _HEARTBEAT
                spoken_at = loop.time()
            if changed is view.changed:
                await _set_within(changed, _CHECK_S)


async def _set_within(event: asyncio.Event, seconds: float) -> None:
    try:
        async with asyncio.timeout(seconds):
            await event.wait()
    except TimeoutError:
        pass


class _LiveAnswer(StreamingResponse):
    """The stream of a viewer, who takes a slot and counts as looking while it is open."""

    def __init__(self, frames: _Frames, *, scope: Scope, slots: Slots, who: str) -> None:
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
