"""Holds offers: while a customer looks at a quote, and while an accepted offer is booked.

A held offer of a quote is planned to begin when its hold has expired, at the earliest: its drone is
kept on the ground until then, and the customer may accept at the last moment.

An offer that a customer accepts now is kept, or its loss is explained.
The gateway answers the customer only after that. The drones and pads of the offer are held until
the gateway has written the delivery and booked it. If the gateway dies before, the hold expires by
itself.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import timedelta
from functools import partial
from typing import Final

from skyway.contracts.mission import Booking, OfferHold
from skyway.contracts.quote import (
    HOLD_GRACE_S,
    HoldLoss,
    HoldTerms,
    KeepOffer,
    KeptOffer,
    QuoteAnswer,
    QuoteQuery,
)
from skyway.delivery.offer import BestValues
from skyway.delivery.qos import PRIORITY_RANKS
from skyway.ids import DeliveryId, DroneId, HoldId
from skyway.runtime.errors import Conflict
from skyway.runtime.sql.database import Tx
from skyway.scheduling.trip import BookedPad, without
from skyway_composition.calendar.attempts import Change, Lost, Settled, carry_out
from skyway_composition.calendar.commit import Snapshot, lock_as_seen
from skyway_composition.context import Context
from skyway_composition.margins import ACCEPTED_IS_BOOKED, Margin
from skyway_composition.missions.booking.clear_way import WaySearch
from skyway_composition.missions.booking.hold_store import (
    HeldOffer,
    Hold,
    add_hold,
    delete_expired,
    drones_of_hold,
    extend_hold,
    free_drones,
    free_pads,
    lock_hold,
    pads_of_drones,
    pads_of_offers,
    slots_of,
    usable_offer,
)
from skyway_composition.missions.booking.rounds import (
    FoundOffer,
    OfferRounds,
    calendars_of,
    with_hold_loss,
)
from skyway_composition.missions.booking.store import FirstLook, first_look
from skyway_composition.missions.booking.turns import AskingOrder, Turns
from skyway_composition.networks.store import Present
from skyway_composition.pads.store import lock_stations
from skyway_composition.planning.availability import Availability, start_ms
from skyway_composition.planning.find_trip import TripFinder
from skyway_composition.planning.offer import Limits, Offers, terms_of
from skyway_composition.planning.plan_offers import best_of_each
from skyway_composition.planning.refusals import refused_for_all
from skyway_composition.planning.world import World

#: At most this many offers of a quote are held, the best first. Our own choice.
MOST_HELD_OFFERS: Final = 3

#: Failed rounds before a quote is answered without a hold.
_MOST_ROUNDS: Final = 3


@dataclass(frozen=True, slots=True)
class _Planned:
    """What providers would offer now, and what it was planned with."""

    world: World
    calendars: Mapping[DroneId, int]
    offers: Offers

    def answer(self, query: QuoteQuery, *, held: int = 0) -> QuoteAnswer:
        """The answer with these offers, of which the first `held` are held."""
        ranked, weights = self.offers.ranked, query.request.qos.ranking
        if not ranked:
            return QuoteAnswer(offers=(), infeasible=self.offers.reasons)
        best = BestValues.of(offer.values for offer in ranked)
        terms = [terms_of(each, best=best, weights=weights, world=self.world) for each in ranked]
        return QuoteAnswer(
            offers=tuple(
                each.model_copy(update={"is_held": number < held})
                for number, each in enumerate(terms)
            ),
            infeasible=self.offers.reasons,
        )


@dataclass(frozen=True, slots=True)
class Quotes:
    """Answers requests for quotes, with and without a hold."""

    context: Context

    async def answer(self, query: QuoteQuery) -> QuoteAnswer:
        """The best offer of each provider, best first, and why the others make no offer.

        Raises
        ------
        Conflict
            TOO_MANY_HOLDS: the customer holds as many quotes as it may.
        """
        if query.hold is not None:
            return await carry_out(self.context, _QuoteHold(self.context, query, query.hold))
        return await _answer_without_hold(self.context, query)


async def _answer_without_hold(context: Context, query: QuoteQuery) -> QuoteAnswer:
    planned = await _plan(context, query, life_s=0.0)
    return planned.answer(query) if isinstance(planned, _Planned) else planned


async def _plan(context: Context, query: QuoteQuery, *, life_s: float) -> _Planned | QuoteAnswer:
    """The best offer of each provider that begins after `life_s` seconds of wall time.

    When no network has the pickup station, it is the answer that says so.
    """
    request, shortlist = query.request, query.shortlist
    pickup = request.pickup.station_id
    present = await context.networks.present_around(pickup)
    if present is None:
        detail = await context.networks.why_missing(pickup)
        reasons = refused_for_all(shortlist.provider_ids, "DESTINATION_UNREACHABLE", detail)
        return QuoteAnswer(offers=(), infeasible=tuple(reasons))
    world = await World.at(present, context.networks, db=context.db, after_ms=context.now_ms)
    begins_ms = max(
        start_ms(context.clock, earliest_at=request.begins_after),
        start_ms(context.clock, earliest_at=None) + _fleet_ms(context, life_s),
    )
    calendars = await calendars_of(context, shortlist.drone_ids)
    limits, booked = Limits.of_whole(request.qos), calendars.missions
    offers = await best_of_each(
        TripFinder(context.solver, world, begins_ms, limits.latest_ms),
        request,
        shortlist=shortlist,
        available=Availability.of(booked, begins_ms=begins_ms, clock=context.clock),
        gaps=[*Availability.in_gaps(booked, begins_ms=begins_ms, clock=context.clock)],
        limits=limits,
    )
    return _Planned(world, calendars.versions, offers)


@dataclass(slots=True)
class _QuoteHold:
    """The cause that holds the best offers of a quote, or answers without a hold."""

    context: Context
    query: QuoteQuery
    terms: HoldTerms
    _rounds: int = 0

    async def propose(self, lost: Lost | None) -> Change[QuoteAnswer] | Settled[QuoteAnswer]:
        """The answer with held offers."""
        if self._rounds == _MOST_ROUNDS:
            return Settled(await _answer_without_hold(self.context, self.query))
        self._rounds += 1
        await delete_expired(self.context.db, now_ms=self.context.now_ms)
        async with self.context.db.read() as connection:
            self._free_slot(await slots_of(connection, self.terms.customer_id))
        held_until_at = self.context.clock.wall_now() + timedelta(seconds=self.terms.life_s)
        planned = await _plan(self.context, self.query, life_s=self.terms.life_s)
        if not isinstance(planned, _Planned):
            return Settled(planned)
        present = planned.world.present
        held = tuple(
            HeldOffer.of(each, present) for each in planned.offers.ranked[:MOST_HELD_OFFERS]
        )
        if not held:
            return Settled(planned.answer(self.query))
        answer = planned.answer(self.query, held=len(held))
        answer = answer.model_copy(update={"held_until_at": held_until_at})
        until_ms = self.context.now_ms + _fleet_ms(self.context, self.terms.life_s + HOLD_GRACE_S)
        hold = Hold(self.terms.hold_id, until_ms, held)
        write = partial(self._write, hold=hold, planned=planned, answer=answer)
        return Change(min(each.starts_ms for each in held), write)

    async def _write(
        self, tx: Tx, *, hold: Hold, planned: _Planned, answer: QuoteAnswer
    ) -> QuoteAnswer:
        pads = await claim_for_hold(tx, hold.offers, planned.world.present, planned.calendars)
        customer_id = self.terms.customer_id
        slot = self._free_slot(await slots_of(tx.connection, customer_id))
        await add_hold(tx, hold, customer_id=customer_id, slot=slot, pads=pads)
        return answer

    def _free_slot(self, slots: Mapping[int, int]) -> int:
        """A free slot number for the customer's next hold; unique in the database."""
        most, clock = self.terms.most, self.context.clock
        for slot in range(1, most + 1):
            if slot not in slots:
                return slot
        if not slots:
            raise Conflict("TOO_MANY_HOLDS", f"the limit is {most} quotes")
        first_ms = min(slots.values()) - _fleet_ms(self.context, HOLD_GRACE_S)
        wait_s = (first_ms - self.context.now_ms) / 1000 / clock.rate
        expires_at = clock.wall_now() + timedelta(seconds=max(0.0, wait_s))
        raise Conflict(
            "TOO_MANY_HOLDS",
            f"{len(slots)} quotes are held and the limit is {most}; the next hold expires at "
            f"{expires_at:%Y-%m-%dT%H:%M:%SZ}",
        )


def _fleet_ms(context: Context, wall_s: float) -> int:
    """A span of wall time, in milliseconds of fleet time."""
    return Margin(0.0, wall_s).ms(context.clock)


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


@dataclass(frozen=True, slots=True)
class OfferKeeper:
    """Keeps offers while they are accepted, and gives up holds that are not needed."""

    context: Context
    turns: Turns

    async def keep(self, asked: KeepOffer) -> KeptOffer:
        """The hold that keeps the offer: as it was planned if that still fits, else planned again.

        A repeated call finds the earlier hold, even if the earlier caller crashed.
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
            search = WaySearch(self.context)
            rounds = OfferRounds(self.context, acceptance, seen, turn, search)
            done = await carry_out(self.context, rounds)
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
        if seen.around is None:
            return "EXPIRED"
        request, now_ms = asked.request, keeper.context.now_ms
        async with keeper.context.db.read() as connection:
            held = await usable_offer(
                connection,
                self.accepted,
                asked.offer,
                request=request,
                present=seen.around,
                now_ms=now_ms,
            )
        if not isinstance(held, HeldOffer):
            return held
        # The registry must still name all held drones as able and allowed to fly.
        if not set(held.drone_ids) <= set(asked.shortlist.drone_ids):
            return "DRONE_NOT_FREE"
        async with keeper.context.db.write() as tx:
            locked = await lock_hold(tx, self.own_hold)
            if locked is None or locked.until_ms <= keeper.context.now_ms:
                return "EXPIRED"
            if locked.until_ms < self._until_ms():
                await extend_hold(tx, self.own_hold, until_ms=self._until_ms())
        return None

    def change(self, found: FoundOffer) -> Change[OfferHold]:
        """Hold the best offer instead of what was held before."""
        return Change(found.begins_ms, partial(self._write, found=found))

    async def join(self, offers: Offers, best: FoundOffer) -> None:
        """An offer that is accepted joins no other mission."""

    async def _write(self, tx: Tx, *, found: FoundOffer) -> OfferHold:
        held = HeldOffer.of(found.offer, found.world.present)
        hold = Hold(self.own_hold, self._until_ms(), (held,))
        # The hold is locked first, in the same order as when a hold is deleted.
        await lock_hold(tx, self.own_hold)
        pads = await claim_for_hold(
            tx, [held], found.world.present, found.calendars, own_hold=self.own_hold
        )
        await add_hold(tx, hold, customer_id=self.asked.customer_id, slot=None, pads=pads)
        return OfferHold(hold_id=self.own_hold, number=0)

    def _until_ms(self) -> int:
        return self.keeper.context.now_ms + ACCEPTED_IS_BOOKED.ms(self.keeper.context.clock)
