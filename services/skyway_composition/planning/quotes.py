"""Quotes: what each provider would offer for a request now, without reserving anything."""

from collections.abc import Awaitable, Callable, Collection, Sequence
from dataclasses import dataclass

from skyway.contracts.quote import QuoteAnswer, QuoteQuery
from skyway.delivery.offer import BestValues
from skyway.ids import DroneId
from skyway.runtime.clock import FleetClock
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms
from skyway_composition.networks.prepared import PreparedNetworks
from skyway_composition.planning.availability import Availability, BookedMission, start_ms
from skyway_composition.planning.find_trip import TripFinder
from skyway_composition.planning.offer import Limits, Offers, terms_of
from skyway_composition.planning.plan_offers import best_of_each
from skyway_composition.planning.refusals import refused_for_all
from skyway_composition.planning.solver_pool import SolverPool
from skyway_composition.planning.world import World

#: Finds the missions in the calendars of these drones.
BookedMissions = Callable[[Collection[DroneId]], Awaitable[Sequence[BookedMission]]]


@dataclass(frozen=True, slots=True)
class Quotes:
    """Answers requests for quotes."""

    db: Database
    networks: PreparedNetworks
    solver: SolverPool
    clock: FleetClock
    booked_missions: BookedMissions

    async def answer(self, query: QuoteQuery) -> QuoteAnswer:
        """The best offer of each provider, best first, and why the others make no offer."""
        pickup = query.request.pickup.station_id
        after_ms = moment_to_ms(self.clock.now())
        world = await World.around(pickup, self.networks, db=self.db, after_ms=after_ms)
        if world is None:
            return await self.pickup_unknown(query)
        begins_ms = start_ms(self.clock, earliest_at=query.request.begins_after)
        booked = await self.booked_missions(query.shortlist.drone_ids)
        offers = await self.plan(query, world, booked, begins_ms=begins_ms)
        return answer_of(query, world, offers)

    async def pickup_unknown(self, query: QuoteQuery) -> QuoteAnswer:
        """The answer when no network has the pickup station."""
        detail = await self.networks.why_missing(query.request.pickup.station_id)
        reasons = refused_for_all(query.shortlist.provider_ids, "DESTINATION_UNREACHABLE", detail)
        return QuoteAnswer(offers=(), infeasible=tuple(reasons))

    async def plan(
        self,
        query: QuoteQuery,
        world: World,
        booked: Sequence[BookedMission],
        *,
        begins_ms: int,
    ) -> Offers:
        """The best offer of each provider for missions that begin at `begins_ms` or later."""
        limits = Limits.of_whole(query.request.qos)
        return await best_of_each(
            TripFinder(self.solver, world, begins_ms, limits.latest_ms),
            query.request,
            shortlist=query.shortlist,
            available=Availability.of(booked, begins_ms=begins_ms, clock=self.clock),
            gaps=[*Availability.in_gaps(booked, begins_ms=begins_ms, clock=self.clock)],
            limits=limits,
        )


def answer_of(query: QuoteQuery, world: World, offers: Offers, *, held: int = 0) -> QuoteAnswer:
    """The answer with these offers, of which the first `held` are held."""
    if not offers.ranked:
        return QuoteAnswer(offers=(), infeasible=offers.reasons)
    best = BestValues.of(offer.values for offer in offers.ranked)
    settings, weights = world.skyway.settings, query.request.qos.ranking
    terms = [
        terms_of(each, best=best, weights=weights, settings=settings) for each in offers.ranked
    ]
    return QuoteAnswer(
        offers=tuple(
            each.model_copy(update={"is_held": number < held}) for number, each in enumerate(terms)
        ),
        infeasible=offers.reasons,
    )
