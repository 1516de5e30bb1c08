"""Keeps an offer that a customer accepts now, or says why it cannot be kept.

The gateway answers the customer only after that. The drones and pads of the offer are held until
the gateway has written the delivery and booked it. If the gateway dies before, the hold expires by
itself.
"""

from dataclasses import dataclass
from functools import partial

from skyway.contracts.mission import Booking, OfferHold
from skyway.contracts.quote import HoldLoss, KeepOffer, KeptOffer
from skyway.delivery.qos import PRIORITY_RANKS
from skyway.ids import DeliveryId, DroneId, HoldId
from skyway.runtime.clock import FleetClock
from skyway.runtime.sql.database import Database, Tx
from skyway.units import moment_to_ms
from skyway_composition.margins import ACCEPTED_IS_BOOKED
from skyway_composition.missions.booking.hold_quote import claim_for_hold
from skyway_composition.missions.booking.hold_store import (
    HeldOffer,
    Hold,
    add_hold,
    delete_expired,
    extend_hold,
    find_hold,
    free_drones,
    free_pads,
    held_offer,
    hold_loss,
    lock_hold,
)
from skyway_composition.missions.booking.outcome import with_hold_loss
from skyway_composition.missions.booking.rounds import FoundOffer, Rounds
from skyway_composition.missions.booking.store import FirstLook, first_look
from skyway_composition.missions.booking.turns import AskingOrder, Turns


@dataclass(frozen=True, slots=True)
class OfferKeeper:
    """Keeps offers while they are accepted, and gives up holds that are not needed."""

    db: Database
    rounds: Rounds
    clock: FleetClock
    turns: Turns

    async def keep(self, asked: KeepOffer) -> KeptOffer:
        """The hold that keeps the offer: as it was planned if that still fits, else planned again.

        A repeated call finds what an earlier one has held, whose caller may have died.
        """
        accepted = asked.offer.hold or OfferHold(hold_id=asked.hold_id, number=0)
        own_hold = accepted.hold_id
        look = partial(self._look, asked, own_hold=own_hold)
        seen = await look()
        loss = await self._extend(asked, accepted, seen)
        if loss is None:
            return KeptOffer(hold=accepted)
        if seen.around is None:
            return KeptOffer(hold=None)
        rank = PRIORITY_RANKS[asked.request.qos.priority]
        order = AskingOrder(rank, self.clock.now(), DeliveryId(asked.hold_id))
        with self.turns.line_up(seen.around.network_id, order) as turn:
            done = await self.rounds.run(
                asked,
                seen,
                turn,
                look=look,
                commit=partial(self._hold, asked, own_hold=own_hold),
                own_hold=own_hold,
            )
        if not isinstance(done, Booking):
            return KeptOffer(hold=done)
        lost = done if asked.offer.hold is None else with_hold_loss(done, loss)
        return KeptOffer(hold=None, reasons=lost.reasons)

    async def release(self, hold_id: HoldId) -> None:
        """Give up what a hold keeps; nothing happens if there is no such hold."""
        async with self.db.write() as tx:
            if await lock_hold(tx, hold_id) is not None:
                await free_drones(tx, hold_id)
                await free_pads(tx, hold_id)

    async def delete_expired(self) -> bool:
        """Step of a loop: delete the holds that have expired; always False.

        No reader counts them any more, but the database still refuses other rows for their pads.
        """
        await delete_expired(self.db, now_ms=self._now_ms())
        return False

    async def _look(self, asked: KeepOffer, *, own_hold: HoldId) -> FirstLook:
        async with self.db.read() as connection:
            return await first_look(
                connection,
                DeliveryId(asked.hold_id),
                attempt=1,
                drone_ids=asked.shortlist.drone_ids,
                pickup=asked.request.pickup.station_id,
                now_ms=self._now_ms(),
                own_hold=own_hold,
            )

    async def _extend(
        self, asked: KeepOffer, accepted: OfferHold, seen: FirstLook
    ) -> HoldLoss | None:
        """Hold the offer until it is booked; or why it cannot be booked as it is held."""
        async with self.db.read() as connection:
            hold = await find_hold(connection, accepted.hold_id)
        held = held_offer(hold, accepted.number, now_ms=self._now_ms())
        if held is None or seen.around is None or not held.keeps(asked.offer):
            return "EXPIRED"
        if not _are_candidates(held, asked.shortlist.drone_ids):
            return "DRONE_NOT_FREE"
        now = await self.rounds.calendars(held.drone_ids, own_hold=accepted.hold_id)
        loss = hold_loss(
            held,
            request=asked.request,
            present=seen.around,
            now=now,
            now_ms=self._now_ms(),
        )
        if loss is not None:
            return loss
        async with self.db.write() as tx:
            locked = await lock_hold(tx, accepted.hold_id)
            if locked is None or locked.until_ms <= self._now_ms():
                return "EXPIRED"
            if locked.until_ms < self._until_ms():
                await extend_hold(tx, accepted.hold_id, until_ms=self._until_ms())
        return None

    async def _hold(
        self, asked: KeepOffer, tx: Tx, found: FoundOffer, *, own_hold: HoldId
    ) -> OfferHold:
        held = HeldOffer.of(found.offer, found.world.present)
        hold = Hold(own_hold, self._until_ms(), (held,))
        # The hold is locked first, in the same order as when a hold is deleted.
        await lock_hold(tx, own_hold)
        pads = await claim_for_hold(
            tx, [held], found.world.present, found.calendars, own_hold=own_hold
        )
        await add_hold(tx, hold, customer_id=asked.customer_id, slot=None, pads=pads)
        return OfferHold(hold_id=own_hold, number=0)

    def _now_ms(self) -> int:
        return moment_to_ms(self.clock.now())

    def _until_ms(self) -> int:
        return self._now_ms() + ACCEPTED_IS_BOOKED.ms(self.clock)


def _are_candidates(held: HeldOffer, drone_ids: tuple[DroneId, ...]) -> bool:
    """Whether the registry still names all held drones as able and allowed to fly."""
    return set(held.drone_ids) <= set(drone_ids)
