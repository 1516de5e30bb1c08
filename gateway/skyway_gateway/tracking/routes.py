"""Tracking over REST: the link of a delivery for its customer, and the page that the link shows.

The page is for phones. It has its state as JSON and a stream. The link is the key.
"""

from functools import partial
from importlib.resources import files
from typing import Annotated, Final

from fastapi import Header, Request, Response
from fastapi.responses import HTMLResponse
from pydantic import Field

from skyway.ids import DeliveryId, PackageId
from skyway.json_model import JsonModel
from skyway.runtime.errors import NotFound
from skyway.runtime.http.entrance import Meters
from skyway.runtime.http.event_stream import EventStreamAnswer
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.limits import Slots
from skyway_gateway.access.routes import KeyCaller
from skyway_gateway.context import Context
from skyway_gateway.deliveries.lifecycle.delivery import Delivery
from skyway_gateway.deliveries.proving.accept_proof import ProofAcceptance, TypedProof
from skyway_gateway.deliveries.proving.photos import Photos
from skyway_gateway.deliveries.proving.routes import picture_answer
from skyway_gateway.deliveries.records import delivery_store
from skyway_gateway.live.feed import LiveFeed
from skyway_gateway.live.scope import Scope
from skyway_gateway.live.viewer_frames import ViewerFrames, event_seen
from skyway_gateway.tracking import link_store
from skyway_gateway.tracking.pages import Shown, TrackingPages
from skyway_gateway.tracking.tracked import TrackedDelivery
from skyway_gateway.tracking_links import TRACKING_PATHS, TrackingLinks


class TrackingLink(JsonModel):
    """Where a delivery can be followed without a key."""

    tracking_url: Annotated[
        str | None,
        Field(
            description="Link to the tracking page, for everybody who may follow the delivery; it "
            "ends 24 hours of fleet time after the delivery. Null when it was withdrawn."
        ),
    ]


def link_routes(context: Context, *, links: TrackingLinks) -> ServiceRouter:
    """GET, POST and DELETE /v1/deliveries/{delivery_id}/tracking-link."""
    router = ServiceRouter(tags=("deliveries",))
    path = "/v1/deliveries/{delivery_id}/tracking-link"

    @router.get(path)
    async def get_tracking_link(delivery_id: DeliveryId, caller: KeyCaller) -> TrackingLink:
        """Show the link to a delivery's tracking page.

        Callers: customer, operator.
        """
        caller.must_be("customer", "operator")
        async with context.db.read() as connection:
            await delivery_store.one_of(connection, caller, delivery_id)
            link = await link_store.link_of(connection, delivery_id)
        if link.is_withdrawn:
            return TrackingLink(tracking_url=None)
        return _link(delivery_id, link.number)

    @router.post(path, status_code=201)
    async def renew_tracking_link(delivery_id: DeliveryId, caller: KeyCaller) -> TrackingLink:
        """Make another link to a delivery's tracking page; the earlier link ends.

        Callers: customer, operator.
        """
        caller.must_be("customer", "operator")
        async with context.db.write() as tx:
            await delivery_store.one_of(tx.connection, caller, delivery_id)
            number = await link_store.renew(tx, delivery_id)
        return _link(delivery_id, number)

    @router.delete(path, status_code=204)
    async def withdraw_tracking_link(delivery_id: DeliveryId, caller: KeyCaller) -> Response:
        """End the link to a delivery's tracking page.

        Callers: customer, operator.
        """
        caller.must_be("customer", "operator")
        async with context.db.write() as tx:
            await delivery_store.one_of(tx.connection, caller, delivery_id)
            await link_store.withdraw(tx, delivery_id)
        return Response(status_code=204)

    def _link(delivery_id: DeliveryId, number: int) -> TrackingLink:
        return TrackingLink(tracking_url=links.url_of(delivery_id, number=number))

    return router


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
    "elements.js": "text/javascript",
    "glide.js": "text/javascript",
    "moments.js": "text/javascript",
    "packages.js": "text/javascript",
    "proofs.js": "text/javascript",
    "said.js": "text/javascript",
    "walk.js": "text/javascript",
    "way_map.js": "text/javascript",
    "words.js": "text/javascript",
}


def page_routes(
    *,
    pages: TrackingPages,
    feed: LiveFeed,
    slots: Slots,
    meters: Meters,
    proofs: ProofAcceptance,
    photos: Photos,
) -> ServiceRouter:
    """Everything below /track/{delivery_id}/{token}."""
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

    @router.post(f"{path}/proof", status_code=204)
    async def give_proof(
        request: Request, delivery_id: DeliveryId, token: str, typed: TypedProof
    ) -> Response:
        """Accept the PIN or the signature of a recipient."""
        await delivery_of(request, (delivery_id, token))
        await proofs.accept_typed(delivery_id, typed)
        return Response(status_code=204)

    @router.get(f"{path}/packages/{{package_id}}/picture")
    async def show_picture(
        request: Request, delivery_id: DeliveryId, token: str, package_id: PackageId
    ) -> Response:
        """The photo or the signature of a hand-over."""
        await delivery_of(request, (delivery_id, token))
        return await picture_answer(photos, (delivery_id, package_id))

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
