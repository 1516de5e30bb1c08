"""Keeps an offer that a customer accepts now, or says why it cannot be kept.

The gateway answers the customer only after that. The drones and pads of the offer are held until
the gateway has written the delivery and booked it. If the gateway dies before, the hold expires by
itself.
"""

from dataclasses import dataclass

from skyway.contracts.mission import Booking, OfferHold
from skyway.contracts.quote import HoldLoss, KeepOffer, KeptOffer
from skyway.delivery.qos import PRIORITY_RANKS
from skyway.ids import DeliveryId, DroneId, HoldId
from skyway.runtime.sql.database import Tx
from skyway_composition.context import Context
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
from skyway_composition.planning.offer import Offers


@dataclass(frozen=True, slots=True)
class OfferKeeper:
    """Keeps offers while they are accepted, and gives up holds that are not needed."""

    context: Context
    rounds: Rounds
    turns: Turns

    async def keep(self, asked: KeepOffer) -> KeptOffer:
        """The hold that keeps the offer: as it was planned if that still fits, else planned again.

        A repeated call finds what an earlier one has held, whose caller may have died.
        """
        acceptance = _Acceptance(self, asked)
        seen = await acceptance.look()
        loss = await acceptance.extend(seen)
        if loss is None:
            return KeptOffer(hold=acceptance.accepted)
        if seen.around is None:
            return KeptOffer(hold=None)
        rank = PRIORITY_RANKS[asked.request.qos.priority]
        order = AskingOrder(rank, self.context.clock.now(), DeliveryId(asked.hold_id))
        with self.turns.line_up(seen.around.network_id, order) as turn:
            done = await self.rounds.run(acceptance, seen, turn)
        if not isinstance(done, Booking):
            return KeptOffer(hold=done)
        lost = done if asked.offer.hold is None else with_hold_loss(done, loss)
        return KeptOffer(hold=None, reasons=lost.reasons)

    async def release(self, hold_id: HoldId) -> None:
        """Give up what a hold keeps; nothing happens if there is no such hold."""
        async with self.context.db.write() as tx:
            if await lock_hold(tx, hold_id) is not None:
                await free_drones(tx, hold_id)
                await free_pads(tx, hold_id)

    async def delete_expired(self) -> bool:
        """Step of a loop: delete the holds that have expired; always False.

        No reader counts them any more, but the database still refuses other rows for their pads.
        """
        await delete_expired(self.context.db, now_ms=self.context.now_ms)
        return False


@dataclass(frozen=True, slots=True)
class _Acceptance:
    """One offer that a customer accepts."""

    keeper: OfferKeeper
    asked: KeepOffer

    @property
    def accepted(self) -> OfferHold:
        """What is held for the offer, or will be."""
        return self.asked.offer.hold or OfferHold(hold_id=self.asked.hold_id, number=0)

    @property
    def own_hold(self) -> HoldId:
        """The hold of the offer."""
        return self.accepted.hold_id

    async def look(self) -> FirstLook:
        """The calendars of the shortlist."""
        async with self.keeper.context.db.read() as connection:
            return await first_look(
                connection,
                DeliveryId(self.asked.hold_id),
                attempt=1,
                drone_ids=self.asked.shortlist.drone_ids,
                pickup=self.asked.request.pickup.station_id,
                now_ms=self.keeper.context.now_ms,
                own_hold=self.own_hold,
            )

    async def extend(self, seen: FirstLook) -> HoldLoss | None:
        """Hold the offer until it is booked; or why it cannot be booked as it is held."""
        keeper, asked = self.keeper, self.asked
        async with keeper.context.db.read() as connection:
            hold = await find_hold(connection, self.own_hold)
        held = held_offer(hold, self.accepted.number, now_ms=keeper.context.now_ms)
        if held is None or seen.around is None or not held.keeps(asked.offer):
            return "EXPIRED"
        if not _are_candidates(held, asked.shortlist.drone_ids):
            return "DRONE_NOT_FREE"
        now = await keeper.rounds.calendars(held.drone_ids, own_hold=self.own_hold)
        loss = hold_loss(
            held, request=asked.request, present=seen.around, now=now, now_ms=keeper.context.now_ms
        )
        if loss is not None:
            return loss
        async with keeper.context.db.write() as tx:
            locked = await lock_hold(tx, self.own_hold)
            if locked is None or locked.until_ms <= keeper.context.now_ms:
                return "EXPIRED"
            if locked.until_ms < self._until_ms():
                await extend_hold(tx, self.own_hold, until_ms=self._until_ms())
        return None

    async def commit(self, tx: Tx, found: FoundOffer) -> OfferHold:
        """Hold the best offer instead of what was held before."""
        held = HeldOffer.of(found.offer, found.world.present)
        hold = Hold(self.own_hold, self._until_ms(), (held,))
        # The hold is locked first, in the same order as when a hold is deleted.
        await lock_hold(tx, self.own_hold)
        pads = await claim_for_hold(
            tx, [held], found.world.present, found.calendars, own_hold=self.own_hold
        )
        await add_hold(tx, hold, customer_id=self.asked.customer_id, slot=None, pads=pads)
        return OfferHold(hold_id=self.own_hold, number=0)

    async def join(self, offers: Offers, best: FoundOffer) -> None:
        """An offer that is accepted joins no other mission."""

    def _until_ms(self) -> int:
        return self.keeper.context.now_ms + ACCEPTED_IS_BOOKED.ms(self.keeper.context.clock)


def _are_candidates(held: HeldOffer, drone_ids: tuple[DroneId, ...]) -> bool:
    """Whether the registry still names all held drones as able and allowed to fly."""
    return set(held.drone_ids) <= set(drone_ids)
