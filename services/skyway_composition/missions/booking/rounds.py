"""Rounds of planning: the best offer is committed in one transaction, or another round begins.

One round reads the world (network, closures, pads, busy drones), plans offers without reserving
anything, and then commits the best offer. If another booking was faster, the database refuses one
of the rows. Then the next best offer is committed, or another round begins.
"""

import asyncio
import logging
from collections.abc import Awaitable, Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, Protocol, TypeVar

from skyway.contracts.candidate import ProviderReason
from skyway.contracts.mission import Booking, BookMissions
from skyway.contracts.quote import KeepOffer
from skyway.contracts.shortlist import Shortlist
from skyway.ids import DroneId, HoldId
from skyway.runtime.errors import RowRefused
from skyway.runtime.metrics import count
from skyway.runtime.sql.database import Tx
from skyway_composition.calendar.commit import WorldChanged
from skyway_composition.context import Context
from skyway_composition.missions.booking.clear_way import (
    Blocked,
    ClearedWay,
    MovedStandby,
    Pause,
    WaySearch,
)
from skyway_composition.missions.booking.hold_store import delete_expired
from skyway_composition.missions.booking.outcome import all_taken, pickup_unknown, without_offer
from skyway_composition.missions.booking.store import FirstLook, SeenCalendars, seen_calendars
from skyway_composition.missions.booking.turns import Turn
from skyway_composition.planning.availability import Availability, BookedMission, start_ms
from skyway_composition.planning.find_trip import TripFinder
from skyway_composition.planning.offer import Limits, Offer, Offers
from skyway_composition.planning.plan_offers import plan_in_calendars
from skyway_composition.planning.world import World

log = logging.getLogger(__name__)

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

    def check_start(self, now_ms: int) -> None:
        """Raise `WorldChanged` if its missions should have begun before now."""
        if self.begins_ms < now_ms:
            raise WorldChanged


class Cause(Protocol[DoneT_co]):
    """Why trips are planned: what was asked for, and how the best offer is committed.

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

    async def commit(self, tx: Tx, found: FoundOffer) -> DoneT_co:
        """Commit the best offer. Raises `WorldChanged` if it must be planned again."""

    async def join(
        self, offers: Offers, best: FoundOffer
    ) -> Callable[[], Awaitable[DoneT_co | None]] | None:
        """The function that joins a waiting mission; None if the best of these offers is better."""


@dataclass(frozen=True, slots=True)
class _Round:
    """What one round may commit: trips of these drones within these limits."""

    number: int
    shortlist: Shortlist
    world: World
    begins_ms: int
    limits: Limits
    delivery_exists: bool


@dataclass(frozen=True, slots=True)
class Rounds:
    """Plans offers in rounds, until one is committed; `pause` passes while drones are asked."""

    context: Context
    pause: Pause = asyncio.sleep

    async def run(
        self,
        cause: Cause[DoneT_co],
        seen: FirstLook,
        turn: Turn,
    ) -> DoneT_co | Booking:
        """What the best offer is committed to, why there is none, or the earlier booking.

        The first round plans with `seen`; each later round reads the state again.
        """
        asked, own_hold = cause.asked, cause.own_hold
        reasons: tuple[ProviderReason, ...] = ()
        search = WaySearch(self.context, self.pause)
        for round_number in range(_MOST_ROUNDS):
            if round_number:
                seen = await cause.look()
            if seen.booked:
                return Booking(outcome="BOOKED", missions=seen.booked)
            if seen.around is None:
                return pickup_unknown(asked)
            now_ms = self.context.now_ms
            world = await World.at(
                seen.around, self.context.networks, db=self.context.db, after_ms=now_ms
            )
            if own_hold is not None:
                world = world.without([own_hold])
            this_round = self._round(
                asked, world, round_number, delivery_exists=seen.delivery_exists
            )
            done, reasons = await self._commit_best(
                cause, this_round, seen.calendars, turn, search=search
            )
            if done is not None:
                return done
        return all_taken(asked, reasons)

    async def calendars(
        self, drone_ids: Collection[DroneId], *, own_hold: HoldId | None = None
    ) -> SeenCalendars:
        """The missions of these drones that are not over, or that the drones may still fly."""
        now_ms = self.context.now_ms
        async with self.context.db.read() as connection:
            return await seen_calendars(connection, drone_ids, now_ms=now_ms, own_hold=own_hold)

    def _round(
        self,
        asked: BookMissions | KeepOffer,
        world: World,
        round_number: int,
        *,
        delivery_exists: bool,
    ) -> _Round:
        offer, shortlist = asked.offer, asked.shortlist
        begins_ms = start_ms(
            self.context.clock,
            earliest_at=asked.request.begins_after,
            # After a round that came too late, the next round has twice the time.
            margin_factor=2**round_number,
        )
        # A customer who accepts an offer has seen its price.
        ceiling = world.skyway.settings.price_ceiling if offer is None else None
        limits = Limits.of(asked.request.qos, ceiling=ceiling).within(offer, start_ms=begins_ms)
        return _Round(
            round_number,
            shortlist if offer is None else shortlist.of_provider(offer.provider_id),
            world,
            begins_ms,
            limits,
            delivery_exists,
        )

    async def _commit_best(
        self,
        cause: Cause[DoneT_co],
        this_round: _Round,
        calendars: SeenCalendars,
        turn: Turn,
        *,
        search: WaySearch,
    ) -> tuple[DoneT_co | Booking | None, tuple[ProviderReason, ...]]:
        """The result of committing the best free offer; None if a new round is needed."""
        asked, finder = cause.asked, self._finder(this_round)
        while True:
            # The finder keeps the trips that it has composed.
            offers = await self._offers(finder, asked, this_round, calendars.missions)
            way = await self._cleared(
                asked, this_round, calendars.missions, offers=offers, search=search
            )
            if way is not None and way.offer is None:
                # Drones have been asked meanwhile: plan with the pads that are free now.
                this_round = self._round(
                    asked,
                    this_round.world.anew(),
                    this_round.number,
                    delivery_exists=this_round.delivery_exists,
                )
                finder = self._finder(this_round)
                continue
            if not offers.ranked and way is None:
                return without_offer(asked, offers.reasons), offers.reasons
            found = FoundOffer(
                offers.ranked[0] if way is None or way.offer is None else way.offer,
                this_round.world,
                calendars.versions,
                this_round.begins_ms,
                this_round.delivery_exists,
                () if way is None else way.moves,
            )
            shared = await cause.join(offers, found)
            await turn.comes()
            if shared is not None and (joined := await shared()) is not None:
                return joined, offers.reasons
            try:
                async with self.context.db.write() as tx:
                    found.check_start(self.context.now_ms)
                    return await cause.commit(tx, found), offers.reasons
            except RowRefused as taken:
                about = {"delivery_id": turn.order.delivery_id, "by": taken.constraint}
                log.info("offer taken", extra=about)
                _count_conflict(taken.constraint)
                # Every other offer was planned around the same pads. The pads may be those of a
                # hold that has expired and is not deleted yet.
                await delete_expired(self.context.db, now_ms=self.context.now_ms)
                return None, offers.reasons
            except WorldChanged as changed:
                _count_conflict("calendar" if changed.drones else "outdated")
                drone_ids, before = this_round.shortlist.drone_ids, calendars
                # The pads may still be free: plan with the calendars as they are now, if changed.
                if changed.drones:
                    calendars = await self.calendars(drone_ids, own_hold=cause.own_hold)
                if calendars == before:
                    return None, offers.reasons

    def _finder(self, this_round: _Round) -> TripFinder:
        begins_ms, latest_ms = this_round.begins_ms, this_round.limits.latest_ms
        return TripFinder(self.context.solver, this_round.world, begins_ms, latest_ms)

    async def _offers(
        self,
        finder: TripFinder,
        asked: BookMissions | KeepOffer,
        this_round: _Round,
        engaged: Sequence[BookedMission],
    ) -> Offers:
        begins_ms = this_round.begins_ms
        return await plan_in_calendars(
            finder,
            asked.request,
            shortlist=this_round.shortlist,
            available=Availability.of(engaged, begins_ms=begins_ms, clock=self.context.clock),
            gaps=Availability.in_gaps(engaged, begins_ms=begins_ms, clock=self.context.clock),
            limits=this_round.limits,
        )

    async def _cleared(
        self,
        asked: BookMissions | KeepOffer,
        this_round: _Round,
        engaged: Sequence[BookedMission],
        *,
        offers: Offers,
        search: WaySearch,
    ) -> ClearedWay | None:
        """How a sooner offer can be booked when the standbys of other drones give way."""

        async def plan(world: World, limits: Limits) -> Offers:
            sooner = replace(this_round, world=world, limits=limits)
            return await self._offers(self._finder(sooner), asked, sooner, engaged)

        world, begins_ms = this_round.world, this_round.begins_ms
        return await search.clear(Blocked(asked, world, begins_ms, this_round.limits, offers), plan)


def _count_conflict(by: str) -> None:
    count("skyway_booking_conflicts", "offers that could not be booked any more", by=by)
