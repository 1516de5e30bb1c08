"""Rounds of planning: the best offer is proposed, or another round begins.

One round reads the world (network, closures, pads, busy drones) and plans offers without reserving
anything. If another booking was faster, the next best offer is proposed, or another round begins.
Without an offer the answer is BUSY for now, or INFEASIBLE for good.
"""

import logging
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Final, Generic, Protocol, TypeVar

from skyway.contracts.candidate import ProviderReason
from skyway.contracts.mission import Booking, BookMissions, OfferLimits
from skyway.contracts.quote import HoldLoss, KeepOffer
from skyway.contracts.shortlist import Shortlist
from skyway.ids import DroneId, HoldId
from skyway.runtime.errors import RowRefused
from skyway.runtime.metrics import count
from skyway_composition.calendar.attempts import Change, Lost, Settled
from skyway_composition.context import Context
from skyway_composition.missions.booking.clear_way import (
    Blocked,
    ClearedWay,
    MovedStandby,
    WaySearch,
)
from skyway_composition.missions.booking.hold_store import delete_expired
from skyway_composition.missions.booking.store import FirstLook, SeenCalendars, seen_calendars
from skyway_composition.missions.booking.turns import Turn
from skyway_composition.planning.availability import Availability, start_ms
from skyway_composition.planning.find_trip import TripFinder
from skyway_composition.planning.offer import Limits, Offer, Offers
from skyway_composition.planning.plan_offers import plan_in_calendars
from skyway_composition.planning.refusals import refused_for_all
from skyway_composition.planning.world import World

log = logging.getLogger(__name__)

DoneT = TypeVar("DoneT")
DoneT_co = TypeVar("DoneT_co", covariant=True)

#: Rounds before the answer is that all drones or pads are taken (docs/reference/booking.md).
_MOST_ROUNDS: Final = 5


@dataclass(frozen=True, slots=True)
class FoundOffer:
    """The best offer of a round, and what it was planned with.

    `calendars` are the numbers of the drones' calendars. `delivery_exists` is False for a delivery
    that was neither booked nor closed before. QUEUED missions of other drones get the standbys of
    `moves` in the same transaction.
    """

    offer: Offer
    world: World
    calendars: Mapping[DroneId, int]
    begins_ms: int
    delivery_exists: bool
    moves: tuple[MovedStandby, ...] = ()


class Demand(Protocol[DoneT_co]):
    """What trips are planned for, and the change that the best offer becomes.

    The drones and pads of `own_hold` count as free.
    """

    @property
    def asked(self) -> BookMissions | KeepOffer:
        """What was asked for."""

    @property
    def own_hold(self) -> HoldId | None:
        """The hold that ends when an offer is committed; None without one."""

    async def look(self) -> FirstLook:
        """The state that a round begins with."""

    def change(self, found: FoundOffer) -> Change[DoneT_co]:
        """The change that the best offer becomes."""

    async def join(self, offers: Offers, best: FoundOffer) -> Change[DoneT_co] | None:
        """The change that joins a waiting mission; None if the best of these offers is better."""


@dataclass(frozen=True, slots=True)
class _Round:
    """The trips of these drones within these limits; the finder keeps those that it composed."""

    shortlist: Shortlist
    world: World
    begins_ms: int
    limits: Limits
    finder: TripFinder

    def sooner(self, world: World, limits: Limits) -> "_Round":
        """The same round in another world, within other limits."""
        finder = TripFinder(self.finder.solver, world, self.begins_ms, limits.latest_ms)
        return replace(self, world=world, limits=limits, finder=finder)


@dataclass(slots=True)
class OfferRounds(Generic[DoneT]):
    """The cause that proposes the best offer for a demand when its turn comes.

    The first round plans with `seen`. Each later round reads the state again.
    """

    context: Context
    demand: Demand[DoneT]
    seen: FirstLook
    turn: Turn
    search: WaySearch
    _rounds: int = 0
    _round: _Round | None = None
    _reasons: tuple[ProviderReason, ...] = ()
    #: The best offer while a shared trip is tried instead.
    _alone: Change[DoneT] | None = None

    async def propose(self, lost: Lost | None) -> Change[DoneT] | Settled[DoneT | Booking]:
        """The best offer; or why there is none, or the earlier booking."""
        if (alone := self._alone) is not None:
            about = {"delivery_id": self.turn.order.delivery_id, "reason": repr(lost)}
            log.info("shared trip could not be booked", extra=about)
            self._alone = None
            return alone
        if lost is not None:
            await self._learn(lost)
        this_round = self._round or await self._begin_round()
        return (
            Settled(this_round) if isinstance(this_round, Booking) else await self._best(this_round)
        )

    async def _learn(self, lost: Lost) -> None:
        """End the round, unless it can go on with other calendars."""
        before, this_round, self._round = self.seen.calendars, self._round, None
        if isinstance(lost, RowRefused):
            about = {"delivery_id": self.turn.order.delivery_id, "by": lost.constraint}
            log.info("offer taken", extra=about)
            _count_conflict(lost.constraint)
            # Every other offer was planned around the same pads. The pads may be those of a hold
            # that has expired and is not deleted yet.
            await delete_expired(self.context.db, now_ms=self.context.now_ms)
            return
        _count_conflict("calendar" if lost.drones else "outdated")
        if lost.drones and this_round is not None:
            drone_ids, own_hold = this_round.shortlist.drone_ids, self.demand.own_hold
            now = await calendars_of(self.context, drone_ids, own_hold=own_hold)
            self.seen = replace(self.seen, calendars=now)
        # Another calendar has changed; the pads of the offer may still be free.
        self._round = None if self.seen.calendars == before else this_round

    async def _begin_round(self) -> _Round | Booking:
        """The next round; the answer if no round is left, or none is needed."""
        asked, own_hold = self.demand.asked, self.demand.own_hold
        if self._rounds == _MOST_ROUNDS:
            return all_taken(asked, self._reasons)
        if self._rounds:
            self.seen = await self.demand.look()
        if self.seen.booked:
            return Booking(outcome="BOOKED", missions=self.seen.booked)
        if self.seen.around is None:
            return pickup_unknown(asked)
        networks, now_ms = self.context.networks, self.context.now_ms
        world = await World.at(self.seen.around, networks, db=self.context.db, after_ms=now_ms)
        self._rounds += 1
        return self._in(world if own_hold is None else world.without([own_hold]))

    def _in(self, world: World) -> _Round:
        """The present round in this world."""
        asked = self.demand.asked
        offer, shortlist = asked.offer, asked.shortlist
        begins_ms = start_ms(
            self.context.clock,
            earliest_at=asked.request.begins_after,
            # After a round that came too late, the next round has twice the time.
            margin_factor=2 ** (self._rounds - 1),
        )
        # A customer who accepts an offer has seen its price.
        ceiling = world.skyway.settings.price_ceiling if offer is None else None
        limits = Limits.of(asked.request.qos, ceiling=ceiling).within(offer, start_ms=begins_ms)
        return _Round(
            shortlist if offer is None else shortlist.of_provider(offer.provider_id),
            world,
            begins_ms,
            limits,
            TripFinder(self.context.solver, world, begins_ms, limits.latest_ms),
        )

    async def _best(self, this_round: _Round) -> Change[DoneT] | Settled[Booking]:
        """The best free offer, or the shared trip that is better; why there is no offer."""
        while True:
            offers = await self._offers(this_round)
            way = await self._cleared(this_round, offers)
            if way is None or way.offer is not None:
                break
            # Drones have been asked meanwhile: plan with the pads that are free now.
            this_round = self._in(this_round.world.anew())
        self._round, self._reasons = this_round, offers.reasons
        if way is None and not offers.ranked:
            return Settled(without_offer(self.demand.asked, offers.reasons))
        best = FoundOffer(
            offers.ranked[0] if way is None or way.offer is None else way.offer,
            this_round.world,
            self.seen.calendars.versions,
            this_round.begins_ms,
            self.seen.delivery_exists,
            () if way is None else way.moves,
        )
        alone, shared = self.demand.change(best), await self.demand.join(offers, best)
        await self.turn.comes()
        self._alone = None if shared is None else alone
        return alone if shared is None else shared

    async def _offers(self, this_round: _Round) -> Offers:
        begins_ms, engaged = this_round.begins_ms, self.seen.calendars.missions
        return await plan_in_calendars(
            this_round.finder,
            self.demand.asked.request,
            shortlist=this_round.shortlist,
            available=Availability.of(engaged, begins_ms=begins_ms, clock=self.context.clock),
            gaps=Availability.in_gaps(engaged, begins_ms=begins_ms, clock=self.context.clock),
            limits=this_round.limits,
        )

    async def _cleared(self, this_round: _Round, offers: Offers) -> ClearedWay | None:
        """How a sooner offer can be booked when the standbys of other drones give way."""

        async def plan(world: World, limits: Limits) -> Offers:
            return await self._offers(this_round.sooner(world, limits))

        world, begins_ms, limits = this_round.world, this_round.begins_ms, this_round.limits
        return await self.search.clear(
            Blocked(self.demand.asked, world, begins_ms, limits, offers), plan
        )


async def calendars_of(
    context: Context, drone_ids: Collection[DroneId], *, own_hold: HoldId | None = None
) -> SeenCalendars:
    """The missions of these drones that are not over, or that the drones may still fly."""
    async with context.db.read() as connection:
        now_ms = context.now_ms
        return await seen_calendars(connection, drone_ids, now_ms=now_ms, own_hold=own_hold)


def _count_conflict(by: str) -> None:
    count("skyway_booking_conflicts", "offers that could not be booked any more", by=by)


def without_offer(
    requested: BookMissions | KeepOffer, reasons: tuple[ProviderReason, ...]
) -> Booking:
    """BUSY while a later attempt may succeed, else INFEASIBLE.

    A request for a quoted offer is INFEASIBLE: that offer is lost. Without candidates the answer
    is BUSY; the gateway decides by the registry's reasons.
    """
    if requested.offer is not None:
        return _offer_lost(requested.offer, reasons)
    may_change = requested.shortlist.is_empty or any(reason.is_temporary for reason in reasons)
    return Booking(outcome="BUSY" if may_change else "INFEASIBLE", reasons=reasons)


def pickup_unknown(requested: BookMissions | KeepOffer) -> Booking:
    """INFEASIBLE: the pickup station is in no network."""
    detail = f"pickup station {requested.request.pickup.station_id!r} is in no network"
    reasons = refused_for_all(requested.shortlist.provider_ids, "DESTINATION_UNREACHABLE", detail)
    return Booking(outcome="INFEASIBLE", reasons=tuple(reasons))


def all_taken(requested: BookMissions | KeepOffer, reasons: tuple[ProviderReason, ...]) -> Booking:
    """BUSY because others were faster in every round; a quoted offer is lost."""
    explained = {reason.provider_id for reason in reasons}
    detail = "other bookings have reserved its drones or pads"
    taken = [
        reason.model_copy(update={"is_temporary": True})
        for reason in refused_for_all(requested.shortlist.provider_ids, "TAKEN", detail)
        if reason.provider_id not in explained
    ]
    if requested.offer is not None:
        return _offer_lost(requested.offer, (*reasons, *taken))
    return Booking(outcome="BUSY", reasons=(*reasons, *taken))


def _offer_lost(offer: OfferLimits, reasons: tuple[ProviderReason, ...]) -> Booking:
    """INFEASIBLE with OFFER_LOST: a quoted offer does not wait; the reason says what is lost."""
    own = [each for each in reasons if each.provider_id == offer.provider_id]
    gone = "; ".join(f"{each.code}: {each.detail}" for each in own) or "none of its drones is free"
    promised = (
        f"{offer.price.amount} {offer.price.currency} within {offer.within_s:.0f} s cannot be kept"
    )
    reason = ProviderReason(
        provider_id=offer.provider_id,
        code="OFFER_LOST",
        detail=f"{promised}: {gone}",
        is_temporary=False,
        data={
            "price": offer.price.amount,
            "within_s": offer.within_s,
            "because": [each.code for each in own],
        },
    )
    return Booking(outcome="INFEASIBLE", reasons=(reason,))


def with_hold_loss(booking: Booking, loss: HoldLoss) -> Booking:
    """The answer; its reason OFFER_LOST says why the held drones and pads could not be used."""
    reasons = tuple(
        each.model_copy(
            update={
                "detail": f"{_LOSSES[loss]}; then {each.detail}",
                "data": {**each.data, "hold_loss": loss},
            }
        )
        if each.code == "OFFER_LOST"
        else each
        for each in booking.reasons
    )
    return booking.model_copy(update={"reasons": reasons})


_LOSSES: Final[Mapping[HoldLoss, str]] = {
    "EXPIRED": "the hold of the offer expired before the booking reached composition",
    "NETWORK_CHANGED": "the network or its closures changed while the offer was held",
    "CALENDAR_CHANGED": "its drone's calendar changed while the offer was held",
    "DRONE_NOT_FREE": "its drone is not free, or can no longer fly it",
    "REQUEST_CHANGED": "packages of the request were cancelled while the offer was held",
}
