"""What customers send and see: offers that they accept, and deliveries without ways home."""

from typing import Annotated

from pydantic import Field

from skyway.ids import OfferId, QuoteId
from skyway.json_model import JsonModel
from skyway.runtime.http.identity import Caller
from skyway_gateway.deliveries.lifecycle.delivery import Delivery
from skyway_gateway.deliveries.lifecycle.delivery_parts import FlownMission
from skyway_gateway.deliveries.lifecycle.package_changes import with_p90


def shown_to(caller: Caller, delivery: Delivery) -> Delivery:
    """The delivery for this caller, with the P90 of each ETA.

    Operators see all of it. Customers see no ways home of drones and no counters of planners.
    """
    delivery = with_p90(delivery)
    if caller.role != "customer" or not delivery.missions:
        return delivery
    missions = tuple(_without_the_way_home(mission) for mission in delivery.missions)
    return delivery.model_copy(update={"missions": missions})


def _without_the_way_home(mission: FlownMission) -> FlownMission:
    return mission.model_copy(
        update={
            "plan": mission.plan.model_copy(update={"stats": {}}),
            "home_plan": None,
            "home_recharge": None,
            "released_at": None,
        }
    )


class OfferChoice(JsonModel):
    """An offer of a quote that the customer accepts; the quote holds the request."""

    quote_id: Annotated[QuoteId, Field(description="The quote that holds the offer.")]
    offer_id: Annotated[OfferId, Field(description="The offer to accept.")]


class RequestedDelivery(Delivery):
    """A delivery that was just requested, with the link to its tracking page."""

    tracking_url: Annotated[
        str | None,
        Field(
            description="Link to the tracking page, for everybody who may follow the delivery "
            "without a key. Null for a browser's session, because the link outlives the session."
        ),
    ]
