"""Answers requests for quotes; the best offers are held if the customer asks for that.

A held offer is planned to begin when its hold has expired, at the earliest: its drone is kept on
the ground until then, and the customer may accept at the last moment.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import timedelta
from typing import Final

from skyway.contracts.quote import HOLD_GRACE_S, HoldTerms, QuoteAnswer, QuoteQuery
from skyway.ids import DroneId, HoldId
from skyway.runtime.errors import Conflict, RowRefused
from skyway.runtime.sql.database import Tx
from skyway.scheduling.trip import BookedPad, without
from skyway_composition.calendar.commit import WorldChanged, lock_as_seen
from skyway_composition.calendar.snapshot import Snapshot
from skyway_composition.context import Context
from skyway_composition.margins import Margin
from skyway_composition.missions.booking.hold_store import (
    HeldOffer,
    Hold,
    add_hold,
    delete_expired,
    drones_of_hold,
    free_drones,
    free_pads,
    pads_of_drones,
    pads_of_offers,
    slots_of,
)
from skyway_composition.missions.booking.rounds import Rounds
from skyway_composition.networks.store import Present
from skyway_composition.pads.store import lock_stations
from skyway_composition.planning.availability import start_ms
from skyway_composition.planning.plan_offers import Quotes, answer_of
from skyway_composition.planning.world import World

#: At most this many offers of a quote are held, the best first. Our own choice.
MOST_HELD_OFFERS: Final = 3

#: Failed rounds before a quote is answered without a hold.
_MOST_ROUNDS: Final = 3


@dataclass(frozen=True, slots=True)
class HeldQuotes:
    """Answers requests for quotes, with and without a hold."""

    context: Context
    quotes: Quotes
    rounds: Rounds

    async def answer(self, query: QuoteQuery) -> QuoteAnswer:
        """The best offer of each provider, best first, and why the others make no offer.

        Raises
        ------
        Conflict
            TOO_MANY_HOLDS: the customer holds as many quotes as it may.
        """
        if query.hold is None:
            return await self.quotes.answer(query)
        for _ in range(_MOST_ROUNDS):
            await delete_expired(self.context.db, now_ms=self.context.now_ms)
            async with self.context.db.read() as connection:
                self._free_slot(await slots_of(connection, query.hold.customer_id), query.hold)
            answer = await self._hold_in_round(query, query.hold)
            if answer is not None:
                return answer
        return await self.quotes.answer(query)

    async def _hold_in_round(self, query: QuoteQuery, terms: HoldTerms) -> QuoteAnswer | None:
        """The answer with held offers; None when another booking was faster."""
        pickup = query.request.pickup.station_id
        world = await World.around(
            pickup, self.context.networks, db=self.context.db, after_ms=self.context.now_ms
        )
        if world is None:
            return await self.quotes.pickup_unknown(query)
        life = timedelta(seconds=terms.life_s)
        held_until_at = self.context.clock.wall_now() + life
        begins_ms = max(
            start_ms(self.context.clock, earliest_at=query.request.begins_after),
            start_ms(self.context.clock, earliest_at=None) + self._fleet_ms(terms.life_s),
        )
        calendars = await self.rounds.calendars(query.shortlist.drone_ids)
        offers = await self.quotes.plan(query, world, calendars.missions, begins_ms=begins_ms)
        if not offers.ranked:
            return answer_of(query, world, offers)
        until_ms = self.context.now_ms + self._fleet_ms(terms.life_s + HOLD_GRACE_S)
        held = tuple(HeldOffer.of(each, world.present) for each in offers.ranked[:MOST_HELD_OFFERS])
        try:
            async with self.context.db.write() as tx:
                pads = await claim_for_hold(tx, held, world.present, calendars.versions)
                slots = await slots_of(tx.connection, terms.customer_id)
                slot = self._free_slot(slots, terms)
                hold = Hold(terms.hold_id, until_ms, held)
                await add_hold(tx, hold, customer_id=terms.customer_id, slot=slot, pads=pads)
        except (RowRefused, WorldChanged):
            return None
        answer = answer_of(query, world, offers, held=len(held))
        return answer.model_copy(update={"held_until_at": held_until_at})

    def _free_slot(self, slots: Mapping[int, int], terms: HoldTerms) -> int:
        """A free slot number for the customer's next hold; unique in the database."""
        for slot in range(1, terms.most + 1):
            if slot not in slots:
                return slot
        if not slots:
            raise Conflict("TOO_MANY_HOLDS", f"the limit is {terms.most} quotes")
        first_ms = min(slots.values()) - self._fleet_ms(HOLD_GRACE_S)
        wait_s = (first_ms - self.context.now_ms) / 1000 / self.context.clock.rate
        expires_at = self.context.clock.wall_now() + timedelta(seconds=max(0.0, wait_s))
        raise Conflict(
            "TOO_MANY_HOLDS",
            f"{len(slots)} quotes are held and the limit is {terms.most}; the next hold expires at "
            f"{expires_at:%Y-%m-%dT%H:%M:%SZ}",
        )

    def _fleet_ms(self, wall_s: float) -> int:
        """A span of wall time, in milliseconds of fleet time."""
        return Margin(0.0, wall_s).ms(self.context.clock)


async def claim_for_hold(
    tx: Tx,
    offers: Sequence[HeldOffer],
    present: Present,
    calendars: Mapping[DroneId, int],
    *,
    own_hold: HoldId | None = None,
) -> tuple[BookedPad, ...]:
    """Lock what these offers need and free `own_hold`; returns the pads to hold.

    Pads that a mission of the same drone has reserved are not held twice.

    Raises
    ------
    WorldChanged
        A network was published, a closure made or lifted, or the calendar of a drone has changed,
        since the offers were planned in `present` and with `calendars`.
    """
    drones = {
        part.candidate.drone_id: part.candidate.provider_id
        for held in offers
        for part in held.offer.parts
    }
    seen = Snapshot(present, {each: calendars[each] for each in drones})
    await lock_as_seen(tx, seen, providers=drones, also=await drones_of_hold(tx, own_hold))
    if own_hold is not None:
        await free_drones(tx, own_hold)
    own_pads = await pads_of_drones(tx.connection, tuple(drones))
    pads = without(pads_of_offers(offers), own_pads)
    await lock_stations(tx, pads)
    if own_hold is not None:
        await free_pads(tx, own_hold)
    return pads
