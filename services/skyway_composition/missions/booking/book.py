"""Booking: the best offer for a delivery becomes its missions, all or nothing.

One round reads the world (network, closures, pads, busy drones), plans offers without reserving
anything, and then books the best offer in a single transaction: drones, pads, missions and their
first instructions. If another booking was faster, the database refuses one of these rows. Then the
next best offer is booked, or another round begins. The PUT request has the key (delivery, attempt),
so a repeated request returns what was booked before.
"""

import logging
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from typing import Final

from skyway.contracts.candidate import ProviderReason
from skyway.contracts.mission import Booking, BookMissions, ClosedDelivery
from skyway.contracts.shortlist import Shortlist
from skyway.ids import DeliveryId, DroneId
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import RowRefused
from skyway.runtime.loops import Wake
from skyway.runtime.metrics import count
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Database, Tx
from skyway.units import moment_to_ms
from skyway_composition.missions.booking.engage import WorldChanged, claim, engage
from skyway_composition.missions.booking.outcome import all_taken, pickup_unknown, without_offer
from skyway_composition.missions.booking.store import (
    FirstLook,
    booked_missions,
    first_look,
    missions_of,
)
from skyway_composition.missions.booking.turns import AskingOrder, Turn, Turns
from skyway_composition.missions.mission import store
from skyway_composition.missions.mission.store import add_delivery, close_delivery, lock_delivery
from skyway_composition.networks.prepared import PreparedNetworks
from skyway_composition.planning.availability import Availability, BookedMission, start_ms
from skyway_composition.planning.find_trip import TripFinder
from skyway_composition.planning.offer import Limits, Offer
from skyway_composition.planning.plan_offers import plan_in_calendars
from skyway_composition.planning.solver_pool import SolverPool
from skyway_composition.planning.world import World

log = logging.getLogger(__name__)

#: Rounds before the answer is that all drones or pads are taken (docs/reference/booking.md).
_MOST_ROUNDS: Final = 5

#: The database rule that one drone has one mission. When it refuses, the pads may still be free.
_DRONE_TAKEN: Final = "mission_drone"


@dataclass(frozen=True, slots=True)
class _Round:
    """What one round may book: trips of these drones within these limits.

    A delivery with `delivery_exists` False has no row yet: it was neither booked nor closed before.
    """

    delivery_id: DeliveryId
    delivery_exists: bool
    requested: BookMissions
    shortlist: Shortlist
    world: World
    begins_ms: int
    limits: Limits


@dataclass(frozen=True, slots=True)
class Bookings:
    """Books missions for deliveries; wakes `calendars` when one is QUEUED behind another."""

    db: Database
    networks: PreparedNetworks
    solver: SolverPool
    clock: FleetClock
    mint: Mint
    calendars: Wake
    turns: Turns = field(default_factory=Turns)

    async def book(self, delivery_id: DeliveryId, requested: BookMissions) -> Booking:
        """The missions of this attempt: booked before, or booked now from the best offer.

        Bookings of one network are committed one at a time, first asked, first booked.
        """
        seen = await self._look(delivery_id, requested)
        if seen.booked:
            return Booking(outcome="BOOKED", missions=seen.booked)
        if seen.around is None:
            return pickup_unknown(requested)
        order = AskingOrder.of(delivery_id, requested, self.clock.now())
        with self.turns.line_up(seen.around.network_id, order) as turn:
            return await self._book_in_rounds(delivery_id, requested, seen, turn)

    async def _book_in_rounds(
        self, delivery_id: DeliveryId, requested: BookMissions, seen: FirstLook, turn: Turn
    ) -> Booking:
        """Book in one of several rounds; the first round plans with what was `seen`."""
        reasons: tuple[ProviderReason, ...] = ()
        for round_number in range(_MOST_ROUNDS):
            if round_number:
                seen = await self._look(delivery_id, requested)
            if seen.booked:
                return Booking(outcome="BOOKED", missions=seen.booked)
            if seen.around is None:
                return pickup_unknown(requested)
            after_ms = moment_to_ms(self.clock.now())
            world = await World.at(seen.around, self.networks, db=self.db, after_ms=after_ms)
            this_round = self._round(
                delivery_id, requested, world, round_number, delivery_exists=seen.delivery_exists
            )
            booking, reasons = await self._book_in(this_round, seen.engaged, turn)
            if booking is not None:
                return booking
        return all_taken(requested, reasons)

    async def _look(self, delivery_id: DeliveryId, requested: BookMissions) -> FirstLook:
        async with self.db.read() as connection:
            return await first_look(
                connection,
                delivery_id,
                attempt=requested.attempt,
                drone_ids=requested.shortlist.drone_ids,
                pickup=requested.request.pickup.station_id,
            )

    async def booked_missions(self, drone_ids: Collection[DroneId]) -> tuple[BookedMission, ...]:
        """The missions of these drones that are not over, or that the drones may still fly."""
        async with self.db.read() as connection:
            return await booked_missions(connection, drone_ids)

    async def close(self, delivery_id: DeliveryId) -> ClosedDelivery:
        """Close this delivery, so that nothing is booked for it, unless it has missions."""
        async with self.db.write() as tx:
            if not await lock_delivery(tx, delivery_id):
                missions = await store.live_missions_of(tx.connection, delivery_id)
                if missions:
                    return ClosedDelivery(is_closed=False, missions=missions)
                await close_delivery(tx, delivery_id, moment_to_ms(self.clock.now()))
            return ClosedDelivery(is_closed=True)

    def _round(
        self,
        delivery_id: DeliveryId,
        requested: BookMissions,
        world: World,
        round_number: int,
        *,
        delivery_exists: bool,
    ) -> _Round:
        offer = requested.offer
        begins_ms = start_ms(
            self.clock,
            earliest_at=requested.request.earliest_pickup_at,
            # After a round that came too late, the next round has twice the time.
            margin_factor=2**round_number,
        )
        limits = Limits.of(requested.request.qos).within(offer, start_ms=begins_ms)
        return _Round(
            delivery_id,
            delivery_exists,
            requested,
            shortlist=(
                requested.shortlist
                if offer is None
                else requested.shortlist.of_provider(offer.provider_id)
            ),
            world=world,
            begins_ms=begins_ms,
            limits=limits,
        )

    async def _book_in(
        self, this_round: _Round, engaged: Sequence[BookedMission], turn: Turn
    ) -> tuple[Booking | None, tuple[ProviderReason, ...]]:
        """The booking of the best offer that is still free; None when a new round is needed."""
        drone_ids, limits = this_round.shortlist.drone_ids, this_round.limits
        world, begins_ms = this_round.world, this_round.begins_ms
        finder = TripFinder(self.solver, world, begins_ms, limits.latest_ms)
        while True:
            # The finder keeps the trips that it has composed.
            offers = await plan_in_calendars(
                finder,
                this_round.requested.request,
                shortlist=this_round.shortlist,
                available=Availability.of(engaged, begins_ms=begins_ms, clock=self.clock),
                gaps=Availability.in_gaps(engaged, begins_ms=begins_ms, clock=self.clock),
                limits=limits,
            )
            if not offers.ranked:
                return without_offer(this_round.requested, offers.reasons), offers.reasons
            best = offers.ranked[0]
            await turn.comes()
            try:
                async with self.db.write() as tx:
                    booking = await self._book_offer(tx, this_round, best, engaged=engaged)
                    return booking, offers.reasons
            except RowRefused as taken:
                delivery_id = this_round.delivery_id
                log.info("offer taken", extra={"delivery_id": delivery_id, "by": taken.constraint})
                _count_conflict(taken.constraint)
                if taken.constraint != _DRONE_TAKEN:
                    # Every other offer was planned around the same pads.
                    return None, offers.reasons
                now_engaged = await self.booked_missions(drone_ids)
                if set(now_engaged) == set(engaged):
                    return None, offers.reasons
                engaged = now_engaged
            except WorldChanged:
                _count_conflict("outdated")
                return None, offers.reasons

    async def _book_offer(
        self,
        tx: Tx,
        this_round: _Round,
        offer: Offer,
        *,
        engaged: Sequence[BookedMission],
    ) -> Booking:
        """Reserve the drones and pads and send the missions, in one transaction.

        A delivery with a row is locked first. A delivery without a row is added at the end, with
        all other new rows.
        """
        delivery_id, requested = this_round.delivery_id, this_round.requested
        if this_round.delivery_exists:
            if await lock_delivery(tx, delivery_id):
                return Booking(outcome="CLOSED")
            booked = await missions_of(tx.connection, delivery_id, attempt=requested.attempt)
            if booked:
                return Booking(outcome="BOOKED", missions=booked)
        else:
            # If another request books or closes it first, the database refuses this row.
            add_delivery(tx, delivery_id)
        if this_round.begins_ms < moment_to_ms(self.clock.now()):
            raise WorldChanged
        # I11: the version is checked inside the transaction and cannot change before its end.
        world = this_round.world
        places = await claim(tx, offer, world, engaged=engaged, clock=self.clock)
        if len(places) < len(offer.parts):
            tx.after_commit(self.calendars.set)
        missions = await engage(
            tx,
            offer,
            world,
            places=places,
            delivery_id=delivery_id,
            attempt=requested.attempt,
            clock=self.clock,
            mint=self.mint,
        )
        return Booking(outcome="BOOKED", missions=missions)


def _count_conflict(by: str) -> None:
    count("skyway_booking_conflicts", "offers that could not be booked any more", by=by)
