"""Booking: the best offer for a delivery becomes its missions, all or nothing.

One transaction books drones, pads, missions and their first instructions (`rounds`). An accepted
offer is booked as it is held, if that still fits. The PUT request has the key (delivery, attempt),
so a repeated request returns what was booked before.
"""

import asyncio
import logging
from dataclasses import dataclass, field
from functools import partial
from time import perf_counter
from typing import Protocol

from skyway.contracts.mission import Booking, BookMissions, ClosedDelivery, Mission
from skyway.contracts.quote import HoldLoss
from skyway.ids import DeliveryId, HoldId
from skyway.runtime.metrics import count, observe
from skyway.runtime.sql.database import Tx
from skyway_composition.calendar.attempts import Change, carry_out, commit
from skyway_composition.context import Context
from skyway_composition.missions.booking.clear_way import Pause, WaySearch
from skyway_composition.missions.booking.engage import claim, claim_delivery, engage
from skyway_composition.missions.booking.hold_store import (
    HeldOffer,
    lock_hold,
    usable_offer,
)
from skyway_composition.missions.booking.rounds import (
    FoundOffer,
    OfferRounds,
    pickup_unknown,
    with_hold_loss,
)
from skyway_composition.missions.booking.store import FirstLook, first_look
from skyway_composition.missions.booking.turns import AskingOrder, Turns
from skyway_composition.missions.mission import store
from skyway_composition.missions.mission.store import close_delivery, lock_delivery
from skyway_composition.networks.store import Present
from skyway_composition.planning.offer import Offers
from skyway_composition.planning.world import World


class SharedTrip(Protocol):
    """A trip that a request shares with the waiting mission of another delivery."""

    @property
    def first_start_ms(self) -> int:
        """The start of the first mission that changes; then it is too late to join."""

    async def join(self, context: Context, tx: Tx) -> Mission:
        """Save it; returns the request's mission. `WorldChanged`: it must be planned again."""


class SharedTrips(Protocol):
    """Finds shared trips."""

    async def find(
        self, delivery_id: DeliveryId, requested: BookMissions, offers: Offers
    ) -> SharedTrip | None:
        """The best shared trip; None if an offer is better."""


log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Bookings:
    """Books missions for deliveries; wakes `calendars` when one is QUEUED behind another."""

    context: Context
    turns: Turns = field(default_factory=Turns)
    pause: Pause = asyncio.sleep
    shared: SharedTrips | None = None
    under_way: dict[tuple[DeliveryId, int], asyncio.Task[Booking]] = field(default_factory=dict)

    async def book(self, delivery_id: DeliveryId, requested: BookMissions) -> Booking:
        """The missions of this attempt: booked before, or booked now from the best offer.

        Bookings of one network are committed one at a time, in the order of the requests. A held
        offer is booked without waiting for others.
        """
        key = delivery_id, requested.attempt
        if (running := self.under_way.get(key)) is not None:
            return await asyncio.shield(running)  # the caller has given up the first call
        attempt = _Attempt(self, delivery_id, requested)
        if requested.shortlist.is_empty:  # only a question: its answer is not that of a real call
            return await attempt.book()
        running = self.under_way[key] = asyncio.create_task(attempt.book())
        running.add_done_callback(lambda _: self.under_way.pop(key))
        return await asyncio.shield(running)

    async def close(self, delivery_id: DeliveryId) -> ClosedDelivery:
        """Close this delivery, so that nothing is booked for it, unless it has missions.

        Missions that have ended count too: their packages may be with the recipients already.
        """
        async with self.context.db.write() as tx:
            if not (await lock_delivery(tx, delivery_id)).is_closed:
                missions = await store.missions_not_refused(tx.connection, delivery_id)
                if missions:
                    return ClosedDelivery(is_closed=False, missions=missions)
                await close_delivery(tx, delivery_id, self.context.now_ms)
            return ClosedDelivery(is_closed=True)


@dataclass(frozen=True, slots=True)
class _Attempt:
    """One attempt to book a delivery."""

    bookings: Bookings
    delivery_id: DeliveryId
    asked: BookMissions

    @property
    def own_hold(self) -> HoldId | None:
        """The hold of the first attempt; a later one follows a mission that its drone refused."""
        offer = self.asked.offer
        if offer is None or offer.hold is None or self.asked.attempt > 1:
            return None
        return offer.hold.hold_id

    async def book(self) -> Booking:
        """The missions of this attempt, or why there are none."""
        began_at = perf_counter()
        booking = await self._booked()
        about, took_s = "time of a booking, from request to outcome", perf_counter() - began_at
        observe("skyway_booking_duration_seconds", about, took_s, outcome=booking.outcome)
        return booking

    async def look(self) -> FirstLook:
        """What is booked for this attempt, and the calendars of the shortlist."""
        async with self.bookings.context.db.read() as connection:
            return await first_look(
                connection,
                self.delivery_id,
                attempt=self.asked.attempt,
                drone_ids=self.asked.shortlist.drone_ids,
                pickup=self.asked.request.pickup.station_id,
                now_ms=self.bookings.context.now_ms,
                own_hold=self.own_hold,
            )

    def change(self, found: FoundOffer) -> Change[Booking]:
        """Reserve the drones and pads and send the missions."""
        return Change(found.begins_ms, partial(self._write, found=found))

    async def join(self, offers: Offers, best: FoundOffer) -> Change[Booking] | None:
        """The change that joins a waiting mission; None if an offer is better."""
        shared = self.bookings.shared
        found = None if shared is None else await shared.find(self.delivery_id, self.asked, offers)
        if found is None:
            return None
        exists = best.delivery_exists
        return Change(found.first_start_ms, partial(self._write_shared, found=found, exists=exists))

    async def _write(self, tx: Tx, *, found: FoundOffer) -> Booking:
        context = self.bookings.context
        earlier = await claim_delivery(
            tx, self.delivery_id, self.asked.attempt, exists=found.delivery_exists
        )
        if earlier is not None:
            return earlier
        if self.own_hold is not None:
            # Locked before the network and the drones, as it is when it is deleted.
            await lock_hold(tx, self.own_hold)
        places = await claim(
            context,
            tx,
            found.offer,
            found.world,
            calendars=found.calendars,
            own_hold=self.own_hold,
            moves=found.moves,
        )
        if len(places) < len(found.offer.parts):
            tx.after_commit(context.calendars.set)
        missions = await engage(
            context,
            tx,
            found.offer,
            found.world,
            places=places,
            delivery_id=self.delivery_id,
            attempt=self.asked.attempt,
        )
        return Booking(outcome="BOOKED", missions=missions)

    async def _booked(self) -> Booking:
        seen = await self.look()
        if seen.booked:
            return Booking(outcome="BOOKED", missions=seen.booked)
        if seen.around is None:
            return pickup_unknown(self.asked)
        loss: HoldLoss | None = None
        if self.own_hold is not None:
            booked = await self._book_held(self.own_hold, seen, seen.around)
            if isinstance(booked, Booking):
                return booked
            loss = booked
        order = AskingOrder.of(self.delivery_id, self.asked, self.bookings.context.clock.now())
        with self.bookings.turns.line_up(seen.around.network_id, order) as turn:
            search = WaySearch(self.bookings.context, self.bookings.pause)
            rounds = OfferRounds(self.bookings.context, self, seen, turn, search)
            booking = await carry_out(self.bookings.context, rounds)
        return booking if loss is None else with_hold_loss(booking, loss)

    async def _book_held(
        self, own_hold: HoldId, seen: FirstLook, present: Present
    ) -> Booking | HoldLoss:
        """Book the offer as it is held; or why that cannot be done."""
        context, offer = self.bookings.context, self.asked.offer
        if offer is None or offer.hold is None:
            return "EXPIRED"
        request, now_ms = self.asked.request, context.now_ms
        async with context.db.read() as connection:
            held = await usable_offer(
                connection, offer.hold, offer, request=request, present=present, now_ms=now_ms
            )
        if not isinstance(held, HeldOffer):
            return held
        world = await World.at(present, context.networks, db=context.db, after_ms=context.now_ms)
        found = FoundOffer(held.offer, world, held.calendars, held.starts_ms, seen.delivery_exists)
        done = await commit(context, self.change(found))
        if isinstance(done, Booking):
            return done
        about = {"delivery_id": self.delivery_id, "reason": repr(done)}
        log.info("held offer could not be booked", extra=about)
        return "CALENDAR_CHANGED"

    async def _write_shared(self, tx: Tx, *, found: SharedTrip, exists: bool) -> Booking:
        earlier = await claim_delivery(tx, self.delivery_id, self.asked.attempt, exists=exists)
        if earlier is not None:
            return earlier
        mission = await found.join(self.bookings.context, tx)
        tx.after_commit(self.bookings.context.calendars.set)
        about = "deliveries that joined the mission of another one"
        tx.after_commit(partial(count, "skyway_shared_trips", about))
        return Booking(outcome="BOOKED", missions=(mission,))
