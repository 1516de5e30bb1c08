"""Accepts an offer of a quote: once, by its customer, before it expires."""

from dataclasses import dataclass
from datetime import datetime

from skyway.contracts.mission import OfferHold, OfferLimits
from skyway.delivery.request import DeliveryRequest
from skyway.ids import DeliveryId, OfferId, QuoteId
from skyway.runtime.errors import Conflict
from skyway.runtime.http.identity import Caller
from skyway.runtime.sql.database import Tx
from skyway_gateway.quotes import store


@dataclass(frozen=True, slots=True)
class AcceptedOffer:
    """The request of the quote, and the limits that the offer promised."""

    request: DeliveryRequest
    limits: OfferLimits


async def accept_offer(
    tx: Tx,
    caller: Caller,
    quote_id: QuoteId,
    offer_id: OfferId,
    *,
    delivery_id: DeliveryId,
    hold: OfferHold | None = None,
    wall_now: datetime,
) -> AcceptedOffer:
    """Accept an offer for a delivery that is written in the same transaction.

    `hold` is what composition holds for the offer until it is booked.

    Raises
    ------
    NotFound
        There is no such quote, it is not the caller's, or it holds no such offer.
    Conflict
        QUOTE_TAKEN: an offer of the quote was accepted before. QUOTE_EXPIRED.
    """
    quote = await store.one_of(tx.connection, caller, quote_id)
    offer = quote.offers[quote.number_of(offer_id)]
    if quote.taken_offer_id is None and wall_now >= offer.expires_at:
        raise Conflict("QUOTE_EXPIRED", f"offer {offer_id} expired at {offer.expires_at}")
    # The write decides, not the read above: two calls may accept at the same time.
    if not await store.mark_accepted(tx, quote_id, offer_id, delivery_id=delivery_id):
        raise Conflict("QUOTE_TAKEN", f"an offer of quote {quote_id} was accepted before")
    promised = OfferLimits(
        provider_id=offer.provider_id,
        price=offer.price,
        within_s=offer.delivery_time_s,
        hold=hold,
    )
    return AcceptedOffer(quote.request, promised)
