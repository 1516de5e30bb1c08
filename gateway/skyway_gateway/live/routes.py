"""GET /v1/live: the live picture as server-sent events."""

from functools import partial
from typing import Annotated

from fastapi import Header, Query, Request, Response
from fastapi.responses import StreamingResponse
from pydantic import Field

from skyway.ids import is_live_account
from skyway.json_model import QueryModel
from skyway.runtime.errors import AccessDenied
from skyway.runtime.http.entrance import Meters
from skyway.runtime.http.event_stream import EventStreamAnswer
from skyway.runtime.http.identity import Caller
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.limits import Meter, Slots
from skyway_gateway.access.routes import KeyCaller
from skyway_gateway.live.feed import LiveFeed
from skyway_gateway.live.scope import Scope
from skyway_gateway.live.viewer_frames import ViewerFrames, event_seen


class LiveQuery(QueryModel):
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


def live_routes(*, feed: LiveFeed, slots: Slots, meters: Meters) -> ServiceRouter:
    """GET /v1/live."""
    router = ServiceRouter(tags=("live",))

    @router.get(
        "/v1/live",
        response_class=StreamingResponse,
        responses={200: {"content": {"text/event-stream": {"schema": {"type": "string"}}}}},
    )
    async def stream_live_picture(
        request: Request,
        caller: KeyCaller,
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
        if not is_live_account(caller.subject_id):
            raise AccessDenied("the live picture shows no test deliveries: follow their events")
        scope = Scope.of(caller, kinds=query.kinds, bbox=query.bbox)
        frames = ViewerFrames(
            feed,
            event_seen(last_event_id),
            request.state.is_still_known,
            pay=partial(pay, meters.tenants, caller),
        )
        return EventStreamAnswer(frames.opened(scope), slots=slots, who=str(caller))

    return router


def pay(meter: Meter, caller: Caller, cost: float) -> None:
    """Take the cost, at most half of a whole budget: nobody is shut out for ever.

    Operators pay nothing: all of them share one snapshot, and none must wait for it.
    """
    if caller.role != "operator":
        meter.spend(str(caller), min(cost, meter.budget.burst / 2))
