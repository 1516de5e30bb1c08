"""Tracking links over REST: their customer reads, renews and withdraws them."""

from typing import Annotated

from fastapi import Response
from pydantic import Field

from skyway.ids import DeliveryId
from skyway.json_model import JsonModel
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.sql.database import Database
from skyway_gateway.access.routes import KeyCaller
from skyway_gateway.deliveries.records import delivery_store
from skyway_gateway.tracking import link_store
from skyway_gateway.tracking_links import TrackingLinks


class TrackingLink(JsonModel):
    """Where a delivery can be followed without a key."""

    tracking_url: Annotated[
        str | None,
        Field(
            description="Link to the tracking page, for everybody who may follow the delivery; it "
            "ends 24 hours of fleet time after the delivery. Null when it was withdrawn."
        ),
    ]


def link_routes(*, db: Database, links: TrackingLinks) -> ServiceRouter:
    """GET, POST and DELETE /v1/deliveries/{delivery_id}/tracking-link."""
    router = ServiceRouter(tags=("deliveries",))
    path = "/v1/deliveries/{delivery_id}/tracking-link"

    @router.get(path)
    async def get_tracking_link(delivery_id: DeliveryId, caller: KeyCaller) -> TrackingLink:
        """Show the link to a delivery's tracking page.

        Callers: customer, operator.
        """
        caller.must_be("customer", "operator")
        async with db.read() as connection:
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
        async with db.write() as tx:
            await delivery_store.one_of(tx.connection, caller, delivery_id)
            number = await link_store.renew(tx, delivery_id)
        return _link(delivery_id, number)

    @router.delete(path, status_code=204)
    async def withdraw_tracking_link(delivery_id: DeliveryId, caller: KeyCaller) -> Response:
        """End the link to a delivery's tracking page.

        Callers: customer, operator.
        """
        caller.must_be("customer", "operator")
        async with db.write() as tx:
            await delivery_store.one_of(tx.connection, caller, delivery_id)
            await link_store.withdraw(tx, delivery_id)
        return Response(status_code=204)

    def _link(delivery_id: DeliveryId, number: int) -> TrackingLink:
        return TrackingLink(tracking_url=links.url_of(delivery_id, number=number))

    return router
