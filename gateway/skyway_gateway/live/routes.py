"""GET /v1/live: the live picture as server-sent events."""

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
from skyway_gateway.live.viewer_frames import ViewerFrames, event_seen

_SSE_HEADERS: Final = {"Cache-Control": "no-store", "X-Accel-Buffering": "no"}


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
        frames = ViewerFrames(feed, event_seen(last_event_id), request.state.is_still_known)
        return _LiveAnswer(frames, scope=scope, slots=slots, who=str(caller))

    return router


class _LiveAnswer(StreamingResponse):
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
