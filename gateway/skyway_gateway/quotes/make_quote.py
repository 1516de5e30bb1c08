"""Makes quotes: checks the request, asks for candidates, has composition plan, writes once."""

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Annotated

from pydantic import Field

from skyway.announced_networks import CachedNetworks
from skyway.contracts.candidate import CandidateQuery, ProviderReason
from skyway.contracts.message import utc_text
from skyway.contracts.mission import OfferLimits
from skyway.contracts.quote import HoldTerms, OfferTerms, QuoteAnswer, QuoteQuery
from skyway.delivery.offer import BestValues, OfferValues, Tariff, rank_offers
from skyway.delivery.qos import ProviderChoice, Weights
from skyway.delivery.request import DeliveryRequest
from skyway.errors import InvalidInput, SkywayError
from skyway.ids import HoldId, OfferId, QuoteId, SubjectId, kind_for
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import RemoteProblem, ServiceUnavailable
from skyway.runtime.http.identity import Caller
from skyway.runtime.idempotency_store import Answer, KeyedCall, answered_before, once
from skyway.runtime.limits import FairQueue
from skyway.runtime.metrics import count
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Database, Tx
from skyway_gateway.clients import Composition, Registry
from skyway_gateway.lateness.lateness_forecast import (
    LatenessForecast,
    conditions_of_offer,
    due_of,
    p90_of,
)
from skyway_gateway.places.customer_request import CustomerRequest
from skyway_gateway.places.serve import PlaceServer
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
            "customer until the offers expire. They then begin after that. The nearest station of "
            "each place serves: other stations are not compared.",
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
class Offers:
    """The offers for one variant of a request, and why other providers make none."""

    offers: tuple[Offer, ...]
    infeasible: tuple[ProviderReason, ...]
    expires_wall_at: datetime
    is_held: bool


def ranked(offers: Sequence[Offer], weights: Weights, *, made_at: datetime) -> tuple[Offer, ...]:
    """Offers for several variants of a request, scored together, the best first.

    The time of an offer counts from `made_at`. Composition scores the offers of one variant only.
    Offers of equal rank stay in the order of their variants.
    """
    values = [
        OfferValues(
            time_s=(max(each.eta_at for each in offer.packages) - made_at).total_seconds(),
            price=offer.price.amount,
            energy_j=offer.energy_j,
            provider_id=offer.provider_id,
            drone_id=offer.drone_id,
            no_shows=offer.no_shows,
        )
        for offer in offers
    ]
    order = rank_offers(values, weights)
    best = BestValues.of(values) if values else None
    return tuple(
        offers[index].model_copy(update={"score": best.score(values[index], weights)})
        for index in order
        if best is not None
    )


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
    places: PlaceServer

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
        served = await self.places.serve(requested, who=str(caller))
        hold = self._hold_terms(caller, requested)
        # Held offers of a variant that is not accepted would keep drones from others.
        variants = served.variants if hold is None else served.variants[:1]
        found = [await self.offers(caller, each, hold=hold) for each in variants]
        offers = tuple(offer for each in found for offer in each.offers)
        if len(found) > 1:
            offers = ranked(offers, requested.qos.ranking, made_at=self.clock.now())
        offering = {each.provider_id for each in offers}
        reasons = (each for each in found[0].infeasible if each.provider_id not in offering)
        quote = Quote(
            quote_id=QuoteId(self.mint(kind_for(caller.subject_id, "quo"))),
            request=served.nearest,
            places=served.places,
            made_at=self.clock.now(),
            expires_wall_at=min(each.expires_wall_at for each in found),
            offers=offers,
            infeasible=tuple(reasons),
        )
        is_held = hold is not None and any(each.is_held for each in found)
        return _Made(quote, hold.hold_id if hold is not None and is_held else None)

    async def offers(
        self,
        caller: Caller,
        request: DeliveryRequest,
        *,
        hold: HoldTerms | None = None,
        kept: OfferLimits | None = None,
    ) -> Offers:
        """The offers for one variant of a request, planned in the caller's turn.

        With `kept`, an offer that was accepted before, only its provider is asked, and its tariff
        counts. Errors are those of `make`.
        """
        checked = await self.checks.check(request)
        asking = request.qos.providers
        if kept is not None:
            asking = ProviderChoice(pinned=kept.provider_id)
        query = CandidateQuery.of(request, checked.pickup_position, providers=asking)
        found = await self.registry.candidates(query)
        if kept is not None:
            shortlist = found.shortlist.with_tariff(kept.provider_id, kept.tariff)
            found = found.model_copy(update={"shortlist": shortlist})
        answer = QuoteAnswer(offers=(), infeasible=())
        if not found.shortlist.is_empty:
            waiting = request.begun_after_wait(self.clock.now())
            asked = QuoteQuery(request=waiting, shortlist=found.shortlist, hold=hold)
            async with self.planning.turn(str(caller)):
                answer = await self.composition.quote(asked)
        infeasible = (*answer.infeasible, *found.infeasible)
        if not answer.offers and not infeasible:
            infeasible = (NO_PROVIDER,)
        # Offers expire this long after composition has answered.
        expires_wall_at = self.clock.wall_now() + timedelta(seconds=OFFER_LIFE_S)
        expires_wall_at = answer.held_until_at or expires_wall_at
        offers = tuple(
            self._offer(
                terms,
                request,
                expires_wall_at=expires_wall_at,
                tariff=found.shortlist.terms_of[terms.provider_id].tariff,
            )
            for terms in answer.offers
        )
        is_held = answer.held_until_at is not None
        return Offers(offers, infeasible, expires_wall_at, is_held=is_held)

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
        plans = [conditions_of_offer(terms)]
        share = self.forecast.late_share(network_id, terms.provider_id, plans)
        last_at = max(each.eta_at for each in terms.packages)
        start_at = last_at - timedelta(seconds=terms.delivery_time_s)
        ends = {each.package_id: each.destination.station_id for each in request.packages}
        packages = []
        for each in terms.packages:
            p90_at = p90_of(each.eta_at, start_at=start_at, share=share)
            due_at = due_of(each.package_id, each.eta_at, p90_at, request)
            packages.append(
                OfferedPackage(
                    **dict(each),
                    destination_station_id=ends[each.package_id],
                    eta_p90_at=p90_at,
                    due_at=due_at,
                )
            )
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


def _count(quote: Quote) -> None:
    if not quote.livemode:
        return
    count("skyway_quotes", "quotes made", outcome="offers" if quote.offers else "no_offer")
    count("skyway_offers", "offers made in quotes", float(len(quote.offers)))
