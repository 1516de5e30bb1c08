"""Bookings over REST: the gateway books and closes deliveries."""

from typing import Annotated

from fastapi import Depends

from skyway.contracts.mission import Booking, BookMissions, ClosedDelivery
from skyway.ids import DeliveryId
from skyway.runtime.http.app import internal_body
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.service_router import ServiceRouter
from skyway_composition.missions.booking.book import Bookings


def booking_routes(*, gate: ServiceGate, bookings: Bookings) -> ServiceRouter:
    """The gateway's PUTs under /internal/deliveries."""
    router = ServiceRouter(tags=("missions",))

    @router.put("/internal/deliveries/{delivery_id}/missions")
    async def book_missions(
        delivery_id: DeliveryId,
        caller: Annotated[Caller, Depends(gate)],
        requested: Annotated[BookMissions, Depends(internal_body(BookMissions))],
    ) -> Booking:
        """Book the best offer; the same attempt again answers the same missions."""
        caller.must_be("service")
        return await bookings.book(delivery_id, requested)

    @router.put("/internal/deliveries/{delivery_id}/closed")
    async def close_delivery(
        delivery_id: DeliveryId, caller: Annotated[Caller, Depends(gate)]
    ) -> ClosedDelivery:
        """Book nothing more for a delivery, unless something is booked already."""
        caller.must_be("service")
        return await bookings.close(delivery_id)

    return router
