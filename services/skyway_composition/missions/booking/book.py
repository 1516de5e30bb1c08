"""Booking: the best offer for a delivery becomes its missions, all or nothing.

One transaction books drones, pads, missions and their first instructions (`rounds`). An accepted
offer is booked as it is held, if that still fits. The PUT request has the key (delivery, attempt),
so a repeated request returns what was booked before.
"""

import asyncio
import logging
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from functools import partial
from time import perf_counter

from skyway.contracts.mission import Booking, BookMissions, ClosedDelivery
from skyway.contracts.quote import HoldLoss
from skyway.ids import DeliveryId, HoldId
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import RowRefused
from skyway.runtime.loops import Wake
from skyway.runtime.metrics import count, observe
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Database, Tx
from skyway.units import moment_to_ms
from skyway_composition.calendar.commit import WorldChanged
from skyway_composition.missions.booking.clear_way import Pause
from skyway_composition.missions.booking.engage import claim, claim_delivery, engage
from skyway_composition.missions.booking.hold_store import (
    HeldOffer,
    find_hold,
    held_offer,
    hold_loss,
    lock_hold,
)
from skyway_composition.missions.booking.outcome import pickup_unknown, with_hold_loss
from skyway_composition.missions.booking.rounds import FoundOffer, Rounds
from skyway_composition.missions.booking.shared_trip import SharedTrip, SharedTrips
from skyway_composition.missions.booking.store import FirstLook, first_look
from skyway_composition.missions.booking.turns import AskingOrder, Turns
from skyway_composition.missions.mission import store
from skyway_composition.missions.mission.store import close_delivery, lock_delivery
from skyway_composition.networks.prepared import PreparedNetworks
from skyway_composition.networks.store import Present
from skyway_composition.planning.offer import Offers
from skyway_composition.planning.solver_pool import SolverPool
from skyway_composition.planning.world import World

log = logging.getLogger(__name__)


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
    pause: Pause = asyncio.sleep
    shared: SharedTrips | None = None
    under_way: dict[tuple[DeliveryId, int], asyncio.Task[Booking]] = field(default_factory=dict)

    @property
    def rounds(self) -> Rounds:
        """The rounds of planning in which it books."""
        return Rounds(self.db, self.networks, self.solver, self.clock, self.mint, self.pause)

    async def book(self, delivery_id: DeliveryId, requested: BookMissions) -> Booking:
        """The missions of this attempt: booked before, or booked now from the best offer.

        Bookings of one network are committed one at a time, in the order of the requests. A held
        offer is booked without waiting for others.
        """
        key = delivery_id, requested.attempt
        if (running := self.under_way.get(key)) is not None:
            return await asyncio.shield(running)  # the caller has given up the first call
        if requested.shortlist.is_empty:  # only a question: its answer is not that of a real call
            return await self._timed(delivery_id, requested)
        running = self.under_way[key] = asyncio.create_task(self._timed(delivery_id, requested))
        running.add_done_callback(lambda _: self.under_way.pop(key))
        return await asyncio.shield(running)

    async def _timed(self, delivery_id: DeliveryId, requested: BookMissions) -> Booking:
        began_at = perf_counter()
        booking = await self._book(delivery_id, requested)
        about, took_s = "time of a booking, from request to outcome", perf_counter() - began_at
        observe("skyway_booking_duration_seconds", about, took_s, outcome=booking.outcome)
        return booking

    async def _book(self, delivery_id: DeliveryId, requested: BookMissions) -> Booking:
        own_hold = _hold_of(requested)
        look = partial(self._look, delivery_id, requested, own_hold=own_hold)
        seen = await look()
        if seen.booked:
            return Booking(outcome="BOOKED", missions=seen.booked)
        if seen.around is None:
            return pickup_unknown(requested)
        loss: HoldLoss | None = None
        if own_hold is not None:
            booked = await self._book_held(delivery_id, requested, seen, seen.around)
            if isinstance(booked, Booking):
                return booked
            loss = booked
        commit = partial(self._book_offer, delivery_id, requested, own_hold=own_hold)
        order = AskingOrder.of(delivery_id, requested, self.clock.now())
        with self.turns.line_up(seen.around.network_id, order) as turn:
            booking = await self.rounds.run(
                requested,
                seen,
                turn,
                look=look,
                commit=commit,
                join=partial(self._shared, delivery_id, requested),
                own_hold=own_hold,
            )
        return booking if loss is None else with_hold_loss(booking, loss)

    async def close(self, delivery_id: DeliveryId) -> ClosedDelivery:
        """Close this delivery, so that nothing is booked for it, unless it has missions.

        Missions that have ended count too: their packages may be with the recipients already.
        """
        async with self.db.write() as tx:
            if not await lock_delivery(tx, delivery_id):
                missions = await store.missions_not_refused(tx.connection, delivery_id)
                if missions:
                    return ClosedDelivery(is_closed=False, missions=missions)
                await close_delivery(tx, delivery_id, moment_to_ms(self.clock.now()))
            return ClosedDelivery(is_closed=True)

    async def _look(
        self, delivery_id: DeliveryId, requested: BookMissions, *, own_hold: HoldId | None
    ) -> FirstLook:
        async with self.db.read() as connection:
            return await first_look(
                connection,
                delivery_id,
                attempt=requested.attempt,
                drone_ids=requested.shortlist.drone_ids,
                pickup=requested.request.pickup.station_id,
                now_ms=self._now_ms(),
                own_hold=own_hold,
            )

    async def _book_held(
        self,
        delivery_id: DeliveryId,
        requested: BookMissions,
        seen: FirstLook,
        present: Present,
    ) -> Booking | HoldLoss:
        """Book the offer as it is held; or why that cannot be done."""
        hold_ref = None if requested.offer is None else requested.offer.hold
        if hold_ref is None:
            return "EXPIRED"
        async with self.db.read() as connection:
            hold = await find_hold(connection, hold_ref.hold_id)
        held = held_offer(hold, hold_ref.number, now_ms=self._now_ms())
        if held is None or requested.offer is None or not held.keeps(requested.offer):
            return "EXPIRED"
        now = await self.rounds.calendars(held.drone_ids, own_hold=hold_ref.hold_id)
        loss = hold_loss(
            held,
            request=requested.request,
            present=present,
            now=now,
            now_ms=self._now_ms(),
        )
        if loss is not None:
            return loss
        world = await World.at(present, self.networks, db=self.db, after_ms=self._now_ms())
        found = _as_found(held, world, delivery_exists=seen.delivery_exists)
        try:
            async with self.db.write() as tx:
                return await self._book_offer(
                    delivery_id, requested, tx, found, own_hold=hold_ref.hold_id
                )
        except WorldChanged:
            return "CALENDAR_CHANGED"
        except RowRefused as refused:
            about = {"delivery_id": delivery_id, "by": refused.constraint}
            log.info("held offer could not be booked", extra=about)
            return "CALENDAR_CHANGED"

    async def _book_offer(
        self,
        delivery_id: DeliveryId,
        requested: BookMissions,
        tx: Tx,
        found: FoundOffer,
        *,
        own_hold: HoldId | None,
    ) -> Booking:
        """Reserve the drones and pads and send the missions, in one transaction."""
        exists = found.delivery_exists
        earlier = await claim_delivery(tx, delivery_id, requested.attempt, exists=exists)
        if earlier is not None:
            return earlier
        if own_hold is not None:
            # Locked before the network and the drones, as it is when it is deleted.
            await lock_hold(tx, own_hold)
        # I11: the version is checked inside the transaction and cannot change before its end.
        places = await claim(
            tx,
            found.offer,
            found.world,
            calendars=found.calendars,
            clock=self.clock,
            own_hold=own_hold,
            moves=found.moves,
        )
        if len(places) < len(found.offer.parts):
            tx.after_commit(self.calendars.set)
        missions = await engage(
            tx,
            found.offer,
            found.world,
            places=places,
            delivery_id=delivery_id,
            attempt=requested.attempt,
            clock=self.clock,
            mint=self.mint,
        )
        return Booking(outcome="BOOKED", missions=missions)

    async def _shared(
        self, delivery_id: DeliveryId, requested: BookMissions, offers: Offers, best: FoundOffer
    ) -> Callable[[], Awaitable[Booking | None]] | None:
        """The function that joins a waiting mission; None if an offer is better."""
        if self.shared is None:
            return None
        found = await self.shared.find(delivery_id, requested, offers)
        return None if found is None else partial(self._join, delivery_id, requested, found, best)

    async def _join(
        self, delivery_id: DeliveryId, requested: BookMissions, found: SharedTrip, best: FoundOffer
    ) -> Booking | None:
        """Join a waiting mission; None if anything has changed since it was planned."""
        try:
            async with self.db.write() as tx:
                booking = await self._book_shared(tx, delivery_id, requested, found, best)
        except (RowRefused, WorldChanged) as changed:
            about = {"delivery_id": delivery_id, "reason": repr(changed)}
            log.info("shared trip could not be booked", extra=about)
            return None
        return booking

    async def _book_shared(
        self,
        tx: Tx,
        delivery_id: DeliveryId,
        requested: BookMissions,
        found: SharedTrip,
        best: FoundOffer,
    ) -> Booking:
        earlier = await claim_delivery(
            tx, delivery_id, requested.attempt, exists=best.delivery_exists
        )
        if earlier is not None:
            return earlier
        mission = await found.join(tx, clock=self.clock, mint=self.mint)
        tx.after_commit(self.calendars.set)
        tx.after_commit(_count_shared)
        return Booking(outcome="BOOKED", missions=(mission,))

    def _now_ms(self) -> int:
        return moment_to_ms(self.clock.now())


def _count_shared() -> None:
    count("skyway_shared_trips", "deliveries that joined the mission of another one")


def _hold_of(requested: BookMissions) -> HoldId | None:
    """The hold of the first attempt; a later one follows a mission that its drone refused."""
    offer = requested.offer
    if offer is None or offer.hold is None or requested.attempt > 1:
        return None
    return offer.hold.hold_id


def _as_found(held: HeldOffer, world: World, *, delivery_exists: bool) -> FoundOffer:
    return FoundOffer(
        offer=held.offer,
        world=world,
        calendars=held.calendars,
        begins_ms=held.starts_ms,
        delivery_exists=delivery_exists,
    )
