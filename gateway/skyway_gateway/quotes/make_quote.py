"""Makes quotes: checks the request, asks for candidates, has composition plan, writes once."""

from dataclasses import dataclass
from datetime import datetime, timedelta

from skyway.contracts.candidate import CandidateQuery
from skyway.contracts.quote import OfferTerms, QuoteAnswer, QuoteQuery
from skyway.delivery.request import DeliveryRequest
from skyway.errors import SkywayError
from skyway.geo import Position
from skyway.ids import OfferId, QuoteId, SubjectId
from skyway.runtime.clock import FleetClock
from skyway.runtime.http.identity import Caller
from skyway.runtime.idempotency.once import Answer, once
from skyway.runtime.metrics import count
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Database, Tx
from skyway_gateway.clients import Composition, Registry
from skyway_gateway.quotes import store
from skyway_gateway.quotes.check_request import NO_PROVIDER, RequestChecks
from skyway_gateway.quotes.store import OFFER_LIFE_S, Offer, Quote


@dataclass(frozen=True, slots=True)
class QuoteMaker:
    """Makes quotes."""

    db: Database
    registry: Registry
    composition: Composition
    checks: RequestChecks
    clock: FleetClock
    mint: Mint

    async def make(
        self,
        caller: Caller,
        request: DeliveryRequest,
        *,
        idempotency_key: str | None,
        body: bytes,
    ) -> Answer:
        """201 with the quote, which has no offers when no provider can serve the request.

        Raises
        ------
        InvalidInput
            A field is impossible now: an unknown station, too heavy, a deadline in the past.
        ServiceUnavailable
            The registry or composition does not answer now.
        """
        try:
            quote: Quote | SkywayError = await self._quote(request)
        except SkywayError as refusal:
            # First look whether this call was answered before.
            quote = refusal

        async def write(tx: Tx) -> Answer:
            if isinstance(quote, SkywayError):
                raise quote
            await store.add(tx, quote, customer_id=SubjectId(caller.subject_id))
            tx.after_commit(lambda: _count(quote))
            location = {"Location": f"/v1/quotes/{quote.quote_id}"}
            return Answer(201, quote.model_dump_json().encode(), location)

        return await once(
            self.db,
            caller=str(caller),
            route="POST /v1/quotes",
            key=idempotency_key,
            body=body,
            act=write,
            clock=self.clock,
        )

    async def _quote(self, request: DeliveryRequest) -> Quote:
        checked = await self.checks.check(request)
        found = await self.registry.candidates(_candidate_query(request, checked.pickup_position))
        answer = QuoteAnswer(offers=(), infeasible=())
        if not found.shortlist.is_empty:
            query = QuoteQuery(request=request, shortlist=found.shortlist)
            answer = await self.composition.quote(query)
        infeasible = (*answer.infeasible, *found.infeasible)
        if not answer.offers and not infeasible:
            infeasible = (NO_PROVIDER,)
        # Offers expire this long after composition has answered.
        expires_at = self.clock.wall_now() + timedelta(seconds=OFFER_LIFE_S)
        return Quote(
            quote_id=QuoteId(self.mint("quo")),
            request=request,
            made_at=self.clock.now(),
            expires_at=expires_at,
            offers=tuple(
                _offer(terms, OfferId(self.mint("off")), expires_at=expires_at)
                for terms in answer.offers
            ),
            infeasible=infeasible,
        )


def _candidate_query(request: DeliveryRequest, position: Position) -> CandidateQuery:
    return CandidateQuery(
        pickup_station_id=request.pickup.station_id,
        pickup_position=position,
        payload_kg=request.payload_kg,
        heaviest_kg=max(package.mass_kg for package in request.packages),
        providers=request.qos.providers,
    )


def _offer(terms: OfferTerms, offer_id: OfferId, *, expires_at: datetime) -> Offer:
    return Offer(**dict(terms), offer_id=offer_id, expires_at=expires_at)


def _count(quote: Quote) -> None:
    count("skyway_quotes", "quotes made", outcome="offers" if quote.offers else "no_offer")
    count("skyway_offers", "offers made in quotes", float(len(quote.offers)))
