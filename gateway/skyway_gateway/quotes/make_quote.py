"""Makes quotes: checks the request, asks for candidates, has composition plan, writes once."""

import contextlib
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Annotated

from pydantic import Field

from skyway.announced_networks import CachedNetworks
from skyway.contracts.candidate import CandidateQuery, cargo_of
from skyway.contracts.message import utc_text
from skyway.contracts.quote import HoldTerms, OfferTerms, QuoteAnswer, QuoteQuery
from skyway.delivery.offer import Tariff
from skyway.delivery.request import DeliveryRequest
from skyway.errors import InvalidInput, SkywayError
from skyway.geo import Position
from skyway.ids import HoldId, OfferId, QuoteId, SubjectId
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import RemoteProblem, ServiceUnavailable
from skyway.runtime.http.identity import Caller
from skyway.runtime.idempotency_store import Answer, KeyedCall, answered_before, once
from skyway.runtime.limits import FairQueue
from skyway.runtime.metrics import count
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Database, Tx
from skyway_gateway.clients import Composition, Registry
from skyway_gateway.lateness.lateness_forecast import LatenessForecast, due_of, p90_of
from skyway_gateway.places.customer_request import CustomerRequest, named_station
from skyway_gateway.quotes import store
from skyway_gateway.quotes.check_request import NO_PROVIDER, RequestChecks
from skyway_gateway.quotes.store import OFFER_LIFE_S, Offer, OfferedPackage, Quote


class QuoteRequest(CustomerRequest):
    """A delivery request, and whether its best offers are held until they expire."""

    hold: Annotated[
        bool,
        Field(
            strict=True,
            description="Whether the drones and pads of the best 3 offers are kept for the "
            "customer until the offers expire. They then begin after that.",
        ),
    ] = False


@dataclass(frozen=True, slots=True)
class HoldLimits:
    """How long offers are held, wall seconds, and how many quotes one customer may hold."""

    life_s: float
    most: int


@dataclass(frozen=True, slots=True)
class _Made:
    """A quote, and what composition holds for it."""

    quote: Quote
    hold_id: HoldId | None


@dataclass(frozen=True, slots=True)
class QuoteMaker:
    """Makes quotes."""

    db: Database
    registry: Registry
    composition: Composition
    checks: RequestChecks
    clock: FleetClock
    mint: Mint
    horizon: timedelta
    limits: HoldLimits
    planning: FairQueue
    networks: CachedNetworks
    forecast: LatenessForecast

    async def make(
        self,
        caller: Caller,
        requested: QuoteRequest,
        call: KeyedCall,
    ) -> Answer:
        """201 with the quote, which has no offers when no provider can serve the request.

        Raises
        ------
        InvalidInput
            A field is impossible now: an unknown station, too heavy, a deadline in the past; or
            offers are to be held for a pickup beyond the booking horizon.
        Conflict
            TOO_MANY_HOLDS: the customer holds as many quotes as it may.
        BudgetSpent
            QUOTES: too many quotes of the caller wait.
        ServiceUnavailable
            The registry or composition does not answer now.
        """
        if requested.hold:
            # A repeated call must not hold other drones.
            before = await answered_before(self.db, call, clock=self.clock)
            if before is not None:
                return before
        try:
            made: _Made | SkywayError = await self._quote(caller, requested)
        except SkywayError as refusal:
            # First look whether this call was answered before.
            made = refusal
        written: list[Quote] = []

        async def write(tx: Tx) -> Answer:
            if isinstance(made, SkywayError):
                raise made
            quote, customer_id = made.quote, SubjectId(caller.subject_id)
            await store.add(tx, quote, customer_id=customer_id, hold_id=made.hold_id)
            tx.after_commit(lambda: written.append(quote))
            location = {"Location": f"/v1/quotes/{quote.quote_id}"}
            return Answer(201, quote.model_dump_json().encode(), location)

        answer = await once(self.db, call, act=write, clock=self.clock)
        if written:
            _count(written[0])
        elif isinstance(made, _Made) and made.hold_id is not None:
            await self._release(made.hold_id)
        return answer

    async def _release(self, hold_id: HoldId) -> None:
        """Give up what is held for a quote that nobody gets."""
        with contextlib.suppress(ServiceUnavailable, RemoteProblem):
            await self.composition.release(hold_id)

    async def _quote(self, caller: Caller, requested: QuoteRequest) -> _Made:
        request = requested.at_stations(named_station)
        hold = self._hold_terms(caller, requested)
        checked = await self.checks.check(request)
        found = await self.registry.candidates(_candidate_query(request, checked.pickup_position))
        answer = QuoteAnswer(offers=(), infeasible=())
        if not found.shortlist.is_empty:
            waiting = request.begun_after_wait(self.clock.now())
            query = QuoteQuery(request=waiting, shortlist=found.shortlist, hold=hold)
            async with self.planning.turn(str(caller)):
                answer = await self.composition.quote(query)
        infeasible = (*answer.infeasible, *found.infeasible)
        if not answer.offers and not infeasible:
            infeasible = (NO_PROVIDER,)
        # Offers expire this long after composition has answered.
        expires_wall_at = self.clock.wall_now() + timedelta(seconds=OFFER_LIFE_S)
        expires_wall_at = answer.held_until_at or expires_wall_at
        quote = Quote(
            quote_id=QuoteId(self.mint("quo")),
            request=request,
            made_at=self.clock.now(),
            expires_wall_at=expires_wall_at,
            offers=tuple(
                self._offer(
                    terms,
                    request,
                    expires_wall_at=expires_wall_at,
                    tariff=found.shortlist.terms_of[terms.provider_id].tariff,
                )
                for terms in answer.offers
            ),
            infeasible=infeasible,
        )
        is_held = hold is not None and answer.held_until_at is not None
        return _Made(quote, hold.hold_id if hold is not None and is_held else None)

    def _offer(
        self,
        terms: OfferTerms,
        request: DeliveryRequest,
        *,
        expires_wall_at: datetime,
        tariff: Tariff,
    ) -> Offer:
        """The offer with the arrival times that are promised."""
        network_id = self.networks.network_of(request.pickup.station_id)
        share = self.forecast.late_share(network_id, terms.provider_id, [terms.margins])
        last_at = max(each.eta_at for each in terms.packages)
        start_at = last_at - timedelta(seconds=terms.delivery_time_s)
        packages = []
        for each in terms.packages:
            p90_at = p90_of(each.eta_at, start_at=start_at, share=share)
            due_at = due_of(each.eta_at, p90_at, request.qos)
            packages.append(OfferedPackage(**dict(each), eta_p90_at=p90_at, due_at=due_at))
        return Offer(
            **(dict(terms) | {"packages": tuple(packages)}),
            offer_id=OfferId(self.mint("off")),
            expires_wall_at=expires_wall_at,
            tariff=tariff,
            late_share=share,
        )

    def _hold_terms(self, caller: Caller, requested: QuoteRequest) -> HoldTerms | None:
        if not requested.hold:
            return None
        pickup_at = requested.earliest_pickup_at
        if pickup_at is not None and pickup_at > self.clock.now() + self.horizon:
            hours = self.horizon.total_seconds() / 3600
            raise InvalidInput(
                "hold",
                f"offers are held only for pickups within the booking horizon of {hours:g} hours; "
                f"earliest_pickup_at is {utc_text(pickup_at)}",
            )
        return HoldTerms(
            hold_id=HoldId(self.mint("hld")),
            customer_id=SubjectId(caller.subject_id),
            life_s=self.limits.life_s,
            most=self.limits.most,
        )


def _candidate_query(request: DeliveryRequest, position: Position) -> CandidateQuery:
    return CandidateQuery(
        pickup_station_id=request.pickup.station_id,
        pickup_position=position,
        payload_kg=request.payload_kg,
        heaviest_kg=max(package.mass_kg for package in request.packages),
        packages=cargo_of(request.packages),
        providers=request.qos.providers,
    )


def _count(quote: Quote) -> None:
    count("skyway_quotes", "quotes made", outcome="offers" if quote.offers else "no_offer")
    count("skyway_offers", "offers made in quotes", float(len(quote.offers)))
