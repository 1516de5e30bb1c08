"""Booking: the best offer for a delivery becomes its missions, all or nothing.

One round looks at the world (network, closures, pads, busy drones), makes offers in it without
holding anything, and then takes the best one in a single transaction: drones, pads, missions and
their first instructions. Whoever was faster made the database refuse one of these rows; then the
next best offer is taken, or another round begins. The PUT behind this is keyed by (delivery,
attempt), so asking again answers what was booked.
"""

import logging
from collections.abc import Collection
from dataclasses import dataclass
from typing import Final

from skyway.contracts.candidate import ProviderReason
from skyway.contracts.mission import Booking, BookMissions, ClosedDelivery
from skyway.contracts.shortlist import Shortlist
from skyway.ids import DeliveryId, DroneId
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import Taken
from skyway.runtime.metrics import count
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Database, Tx
from skyway.units import moment_to_ms
from skyway_composition.missions.booking.engage import WorldChanged, claim, engage
from skyway_composition.missions.booking.outcome import all_taken, pickup_unknown, without_offer
from skyway_composition.missions.booking.store import busy_among, first_look, missions_of
from skyway_composition.missions.mission import store
from skyway_composition.missions.mission.store import add_delivery, close_delivery, lock_delivery
from skyway_composition.networks.prepared import PreparedNetworks
from skyway_composition.planning.find_trip import TripFinder
from skyway_composition.planning.offer import Limits, Offer
from skyway_composition.planning.plan_offers import plan_offers
from skyway_composition.planning.solver_pool import SolverPool
from skyway_composition.planning.trip import start_ms
from skyway_composition.planning.world import World

log = logging.getLogger(__name__)

#: Rounds until the customer is told that all is taken (docs/reference/booking.md).
_MOST_ROUNDS: Final = 5

#: A drone's row in a database rule that refused it: the pads may still be free for another drone.
_DRONE_TAKEN: Final = "mission_drone"


@dataclass(frozen=True, slots=True)
class _Round:
    """What one round books: trips of these drones, within these limits.

    Of a delivery that is not known nothing was booked, and it was not closed.
    """

    delivery_id: DeliveryId
    is_known: bool
    wanted: BookMissions
    shortlist: Shortlist
    finder: TripFinder
    limits: Limits


@dataclass(frozen=True, slots=True)
class Bookings:
    """Books missions for deliveries."""

    db: Database
    networks: PreparedNetworks
    solver: SolverPool
    clock: FleetClock
    mint: Mint

    async def book(self, delivery_id: DeliveryId, wanted: BookMissions) -> Booking:
        """The missions of this attempt: those booked before, or those of the best offer."""
        reasons: tuple[ProviderReason, ...] = ()
        for round_number in range(_MOST_ROUNDS):
            async with self.db.read() as connection:
                seen = await first_look(
                    connection,
                    delivery_id,
                    attempt=wanted.attempt,
                    drone_ids=wanted.shortlist.drone_ids,
                    pickup=wanted.request.pickup.station_id,
                )
            if seen.booked:
                return Booking(outcome="BOOKED", missions=seen.booked)
            if seen.around is None:
                return pickup_unknown(wanted)
            after_ms = moment_to_ms(self.clock.now())
            world = await World.at(seen.around, self.networks, db=self.db, after_ms=after_ms)
            this_round = self._round(
                delivery_id, wanted, world, round_number, is_known=seen.is_known
            )
            booking, reasons = await self._book_in(this_round, seen.busy)
            if booking is not None:
                return booking
        return all_taken(wanted, reasons)

    async def busy_among(self, drone_ids: Collection[DroneId]) -> frozenset[DroneId]:
        """Those of these drones that are on a mission, or may be."""
        async with self.db.read() as connection:
            return await busy_among(connection, drone_ids)

    async def close(self, delivery_id: DeliveryId) -> ClosedDelivery:
        """Book nothing more for this delivery, unless something is booked already."""
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
        wanted: BookMissions,
        world: World,
        round_number: int,
        *,
        is_known: bool,
    ) -> _Round:
        offer = wanted.offer
        begins_ms = start_ms(
            self.clock,
            earliest_at=wanted.request.earliest_pickup_at,
            # A round that came too late leaves the next one twice the time.
            patience=2**round_number,
        )
        limits = Limits.of(wanted.request.qos).within(offer, start_ms=begins_ms)
        return _Round(
            delivery_id,
            is_known,
            wanted,
            shortlist=(
                wanted.shortlist
                if offer is None
                else wanted.shortlist.of_provider(offer.provider_id)
            ),
            finder=TripFinder(self.solver, world, begins_ms, limits.latest_ms),
            limits=limits,
        )

    async def _book_in(
        self, this_round: _Round, busy: frozenset[DroneId]
    ) -> tuple[Booking | None, tuple[ProviderReason, ...]]:
        """The booking of the best offer that nobody else has taken; None when a look is due."""
        drone_ids = this_round.shortlist.drone_ids
        while True:
            offers = await plan_offers(
                this_round.finder,
                this_round.wanted.request,
                shortlist=this_round.shortlist,
                busy=busy,
                limits=this_round.limits,
            )
            if not offers.ranked:
                return without_offer(this_round.wanted, offers.reasons), offers.reasons
            best = offers.ranked[0]
            try:
                async with self.db.write() as tx:
                    return await self._book_offer(tx, this_round, best), offers.reasons
            except Taken as taken:
                delivery_id = this_round.delivery_id
                log.info("offer taken", extra={"delivery_id": delivery_id, "by": taken.constraint})
                _count_conflict(taken.constraint)
                if taken.constraint != _DRONE_TAKEN:
                    # Every other offer was planned around the same pads.
                    return None, offers.reasons
                now_busy = await self.busy_among(drone_ids)
                if not now_busy - busy:
                    return None, offers.reasons
                busy |= now_busy
            except WorldChanged:
                _count_conflict("outdated")
                return None, offers.reasons

    async def _book_offer(self, tx: Tx, this_round: _Round, offer: Offer) -> Booking:
        """Reserve the drones and the pads, and send the missions: one transaction.

        The delivery is locked before anything else; one that nobody knew comes last, with all
        that is added.
        """
        delivery_id, wanted = this_round.delivery_id, this_round.wanted
        if this_round.is_known:
            if await lock_delivery(tx, delivery_id):
                return Booking(outcome="CLOSED")
            booked = await missions_of(tx.connection, delivery_id, attempt=wanted.attempt)
            if booked:
                return Booking(outcome="BOOKED", missions=booked)
        else:
            # Whoever books or closes it meanwhile makes the database refuse it: then it is known.
            add_delivery(tx, delivery_id)
        if this_round.finder.start_ms < moment_to_ms(self.clock.now()):
            raise WorldChanged
        # I11: the version is read inside the transaction, and cannot change before it ends.
        world = this_round.finder.world
        places = await claim(tx, offer, world)
        missions = await engage(
            tx,
            offer,
            world.skyway,
            places=places,
            delivery_id=delivery_id,
            attempt=wanted.attempt,
            clock=self.clock,
            mint=self.mint,
        )
        return Booking(outcome="BOOKED", missions=missions)


def _count_conflict(by: str) -> None:
    count("skyway_booking_conflicts", "offers that could not be taken any more", by=by)
