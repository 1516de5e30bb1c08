"""A quote as its customer sees it: offers that reserve nothing and expire."""

from typing import Annotated, Final

from pydantic import Field

from skyway.contracts.candidate import ProviderReason
from skyway.contracts.message import FleetMoment, WallMoment
from skyway.contracts.quote import OfferTerms
from skyway.delivery.request import DeliveryRequest
from skyway.ids import DeliveryId, OfferId, QuoteId
from skyway.json_model import JsonModel

#: How long an offer can be accepted, seconds of wall time (docs/reference/time.md).
OFFER_LIFE_S: Final = 120.0


class Offer(OfferTerms):
    """What one provider offers; its price and time hold if it is accepted before `expires_at`."""

    offer_id: Annotated[OfferId, Field(description="The id of the offer, to accept it with.")]
    expires_at: WallMoment


class Quote(JsonModel):
    """The offers for a request, the best first, and why other providers make none.

    One of the offers can be accepted, once.
    """

    quote_id: Annotated[QuoteId, Field(description="The id of the quote.")]
    request: Annotated[DeliveryRequest, Field(description="What was requested.")]
    made_at: FleetMoment
    expires_at: WallMoment
    offers: Annotated[tuple[Offer, ...], Field(description="the best first")]
    infeasible: Annotated[
        tuple[ProviderReason, ...], Field(description="Why other providers make no offer.")
    ]
    taken_offer_id: Annotated[
        OfferId | None, Field(description="The accepted offer; null while none is accepted.")
    ] = None
    delivery_id: Annotated[
        DeliveryId | None,
        Field(description="The delivery of the accepted offer; null while none is accepted."),
    ] = None
