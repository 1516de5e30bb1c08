"""What customers send and get when they request a delivery."""

from typing import Annotated

from pydantic import Field

from skyway.ids import OfferId, QuoteId
from skyway.json_model import JsonModel
from skyway_gateway.deliveries.lifecycle.delivery import Delivery


class OfferChoice(JsonModel):
    """An offer of a quote that the customer accepts; the quote holds the request."""

    quote_id: Annotated[QuoteId, Field(description="The quote that holds the offer.")]
    offer_id: Annotated[OfferId, Field(description="The offer to accept.")]


class RequestedDelivery(Delivery):
    """A delivery that was just requested, with the link to its tracking page."""

    tracking_url: Annotated[
        str,
        Field(
            description="Link to the tracking page, for everybody who may follow the delivery "
            "without a key."
        ),
    ]
