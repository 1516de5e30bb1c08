"""The tracking page: a page for phones, its state as JSON, and its stream. The link is the key."""

from functools import partial
from importlib.resources import files
from typing import Annotated, Final

from fastapi import Header, Request, Response
from fastapi.responses import HTMLResponse

from skyway.ids import DeliveryId
from skyway.runtime.errors import NotFound
from skyway.runtime.http.entrance import Meters
from skyway.runtime.http.event_stream import EventStreamAnswer
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.limits import Slots
from skyway_gateway.deliveries.lifecycle.delivery import Delivery
from skyway_gateway.live.feed import LiveFeed
from skyway_gateway.live.scope import Scope
from skyway_gateway.live.viewer_frames import ViewerFrames, event_seen
from skyway_gateway.tracking.pages import Shown, TrackingPages
from skyway_gateway.tracking.tracked import TrackedDelivery
from skyway_gateway.tracking_links import TRACKING_PATHS

#: No other host, no script in the page, no frame around it, and no search engine.
_PAGE_HEADERS: Final = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; "
    "connect-src 'self'; img-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'",
    "Referrer-Policy": "no-referrer",
    "X-Robots-Tag": "noindex, nofollow",
}
_ASSETS: Final = {
    "tracking.css": "text/css",
    "tracking.js": "text/javascript",
    "way_map.js": "text/javascript",
}


def page_routes(
    *, pages: TrackingPages, feed: LiveFeed, slots: Slots, meters: Meters
) -> ServiceRouter:
    """GET below /track/{delivery_id}/{token}."""
    router = ServiceRouter(include_in_schema=False)
    path = f"{TRACKING_PATHS}{{delivery_id}}/{{token}}"

    async def delivery_of(request: Request, shown: Shown) -> Delivery:
        delivery = await pages.delivery_of(shown)
        if delivery is None:
            meters.charge_refused(request)
            raise NotFound("delivery", "of this link: it is wrong, was withdrawn, or is over")
        return delivery

    @router.get(f"{TRACKING_PATHS}assets/{{name}}")
    def show_asset(name: str) -> Response:
        """A file that the page needs."""
        if name not in _ASSETS:
            raise NotFound("asset", name)
        return Response(_file(name), media_type=_ASSETS[name])

    @router.get(path)
    async def show_page(request: Request, delivery_id: DeliveryId, token: str) -> Response:
        """The page."""
        await delivery_of(request, (delivery_id, token))
        return HTMLResponse(_file("index.html"), headers=_PAGE_HEADERS)

    @router.get(f"{path}/state")
    async def show_state(request: Request, delivery_id: DeliveryId, token: str) -> TrackedDelivery:
        """What the page shows."""
        return await pages.state_of(await delivery_of(request, (delivery_id, token)))

    @router.get(f"{path}/events")
    async def stream_changes(
        request: Request,
        delivery_id: DeliveryId,
        token: str,
        last_event_id: Annotated[str | None, Header(max_length=64)] = None,
    ) -> Response:
        """The drones that carry packages of the delivery, and when to look at its state again."""
        shown = (delivery_id, token)
        await delivery_of(request, shown)
        frames = ViewerFrames(feed, event_seen(last_event_id), partial(pages.may_follow, shown))
        opened = frames.opened(Scope.of_link(delivery_id))
        return EventStreamAnswer(opened, slots=slots, who=delivery_id)

    return router


def _file(name: str) -> bytes:
    return (files("skyway_console") / "tracking" / name).read_bytes()
