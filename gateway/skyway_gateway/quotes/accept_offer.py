"""Accepts an offer of a quote: once, by its customer, before it expires.

Composition keeps the offer before the customer gets an answer, so that an accepted offer is not
lost to somebody else. What composition keeps expires by itself if this process dies before it has
written the delivery.
"""

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

from skyway.contracts.candidate import CandidateQuery, ProviderReason
from skyway.contracts.mission import OfferHold, OfferLimits
from skyway.contracts.quote import KeepOffer
from skyway.delivery.qos import ProviderChoice
from skyway.delivery.request import DeliveryRequest
from skyway.ids import DeliveryId, HoldId, OfferId, QuoteId, SubjectId
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import Conflict, RemoteProblem, ServiceUnavailable
from skyway.runtime.http.identity import Caller
from skyway.runtime.sql.database import Tx
from skyway_gateway.clients import Composition, Registry
from skyway_gateway.quotes import store
from skyway_gateway.quotes.check_request import CheckedRequest
from skyway_gateway.quotes.store import Quote


@dataclass(frozen=True, slots=True)
class OfferKeeper:
    """Keeps offers while they are accepted."""

    registry: Registry
    composition: Composition
    clock: FleetClock

    async def keep(
        self,
        caller: Caller,
        quote: Quote,
        offer_id: OfferId,
        *,
        checked: CheckedRequest,
        hold_id: HoldId | None,
    ) -> OfferHold | None:
        """What composition holds for the offer; None if the offer can no longer be accepted.

        `hold_id` names what is held for the offers of the quote.

        Raises
        ------
        Conflict
            OFFER_LOST: the offer cannot be kept; the problem names the next best offer.
        NotFound
            The quote holds no such offer.
        ServiceUnavailable
            The registry or composition does not answer now.
        """
        number = quote.number_of(offer_id)
        offer = quote.offers[number]
        if quote.taken_offer_id is not None or self.clock.wall_now() >= offer.expires_wall_at:
            return None
        query = CandidateQuery.of(
            checked.request,
            checked.pickup_position,
            providers=ProviderChoice(pinned=offer.provider_id),
            kept_drone_ids=(offer.drone_id,),
        )
        found = await self.registry.candidates(query)
        is_held = hold_id is not None and offer.is_held
        asked = KeepOffer(
            # A call that is repeated after this process died finds what was held for it.
            hold_id=HoldId(f"hld_{quote.quote_id}_{number}"),
            customer_id=SubjectId(caller.subject_id),
            request=checked.request.begun_after_wait(self.clock.now()),
            shortlist=found.shortlist.with_tariff(offer.provider_id, offer.tariff),
            offer=offer.limits(
                OfferHold(hold_id=hold_id, number=number) if is_held and hold_id else None
            ),
        )
        kept = await self.composition.keep(asked)
        if kept.hold is None:
            raise _lost(quote, number, (*kept.reasons, *found.infeasible))
        return kept.hold

    async def release(self, hold: OfferHold) -> None:
        """Give up what is held; if composition is away, it expires by itself."""
        with contextlib.suppress(ServiceUnavailable, RemoteProblem):
            await self.composition.release(hold.hold_id)


def _lost(quote: Quote, number: int, reasons: Sequence[ProviderReason]) -> Conflict:
    """The refusal of an offer that cannot be kept, with the offer that ranks after it."""
    lost, *after = quote.offers[number:]
    own = [each for each in reasons if each.provider_id == lost.provider_id]
    why = "; ".join(each.detail for each in own) or "none of its drones is free"
    members: dict[str, object] = {"reasons": [each.model_dump(mode="json") for each in own]}
    if not after:
        then = "the quote has no offer after it: ask for another quote"
    else:
        members["next_offer"] = after[0].model_dump(mode="json")
        then = (
            f"the next best offer of the quote is {after[0].offer_id} of provider "
            f"{after[0].provider_id} for {after[0].price.amount} {after[0].price.currency}"
        )
    detail = f"offer {lost.offer_id} cannot be kept: {why}; {then}"
    return Conflict("OFFER_LOST", detail, members=members)


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
    if quote.taken_offer_id is None and wall_now >= offer.expires_wall_at:
        raise Conflict("QUOTE_EXPIRED", f"offer {offer_id} expired at {offer.expires_wall_at}")
    # The write decides, not the read above: two calls may accept at the same time.
    if not await store.mark_accepted(tx, quote_id, offer_id, delivery_id=delivery_id):
        raise Conflict("QUOTE_TAKEN", f"an offer of quote {quote_id} was accepted before")
    return AcceptedOffer(quote.request_of(offer), offer.limits(hold))
