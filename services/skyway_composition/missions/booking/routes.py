"""Bookings over REST: the gateway books and closes deliveries, and keeps offers."""

from typing import Annotated

from fastapi import Depends

from skyway.contracts.mission import Booking, BookMissions, ClosedDelivery
from skyway.contracts.quote import KeepOffer, KeptOffer
from skyway.ids import DeliveryId, HoldId
from skyway.runtime.http.app import internal_body
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.service_router import ServiceRouter
from skyway_composition.missions.booking.book import Bookings
from skyway_composition.missions.booking.keep_offer import OfferKeeper
from skyway_composition.planning.no_show_store import NoShows


def booking_routes(
    *,
    gate: ServiceGate,
    bookings: Bookings,
    keeper: OfferKeeper,
    no_shows: NoShows,
) -> ServiceRouter:
    """The gateway's calls under /internal/deliveries, /internal/offers and /internal/holds."""
    router = ServiceRouter(tags=("missions",))

    @router.put("/internal/deliveries/{delivery_id}/missions")
    async def book_missions(
        delivery_id: DeliveryId,
        caller: Annotated[Caller, Depends(gate)],
        requested: Annotated[BookMissions, Depends(internal_body(BookMissions))],
    ) -> Booking:
        """Book the best offer; the same attempt again answers the same missions."""
        caller.must_be_service("gateway")
        shortlist = await no_shows.marked(requested.shortlist)
        marked = requested.model_copy(update={"shortlist": shortlist})
        return await bookings.book(delivery_id, marked)

    @router.put("/internal/deliveries/{delivery_id}/closed")
    async def close_delivery(
        delivery_id: DeliveryId, caller: Annotated[Caller, Depends(gate)]
    ) -> ClosedDelivery:
        """Book nothing more for a delivery, unless something is booked already."""
        caller.must_be_service("gateway")
        return await bookings.close(delivery_id)

    @router.post("/internal/offers")
    async def keep_offer(
        caller: Annotated[Caller, Depends(gate)],
        asked: Annotated[KeepOffer, Depends(internal_body(KeepOffer))],
    ) -> KeptOffer:
        """Hold an offer that is accepted now until it is booked, or say why it is lost."""
        caller.must_be_service("gateway")
        return await keeper.keep(asked)

    @router.delete("/internal/holds/{hold_id}", status_code=204)
    async def release_hold(hold_id: HoldId, caller: Annotated[Caller, Depends(gate)]) -> None:
        """Give up what a hold keeps; a hold that does not exist is given up already."""
        caller.must_be_service("gateway")
        await keeper.release(hold_id)

    return router
