"""From a request to booked missions: one round for a delivery with packages that wait.

Each round asks the registry who could fly, then composition to book the best plan, and writes
down what came of it. The process may be killed between any two lines: the row is still in the
queue, and the next round asks again. That is safe, because composition answers the same
(delivery, attempt) with the same missions for ever.
"""

import logging
import random
from collections.abc import Awaitable, Callable, Collection, Sequence
from dataclasses import dataclass, field
from datetime import timedelta
from typing import Final

from skyway.contracts.candidate import ProviderReason
from skyway.contracts.mission import Booking, CancelMissions, Mission
from skyway.contracts.shortlist import Candidates
from skyway.ids import DeliveryId
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import RemoteProblem, ServiceUnavailable
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Database, Tx
from skyway.runtime.tracing import tracing
from skyway_gateway.clients import CANCELLATIONS_PATH, Composition, Registry
from skyway_gateway.deliveries.booking.booking_request import candidate_query, wanted_missions
from skyway_gateway.deliveries.booking.infeasibility import (
    most_refused,
    nobody_asked,
    refusal_reasons,
    why_never,
)
from skyway_gateway.deliveries.booking.queue_store import claim_queued, hold, try_later
from skyway_gateway.deliveries.lifecycle.booking_effects import (
    after_booking,
    after_giving_up,
    unwanted,
)
from skyway_gateway.deliveries.lifecycle.delivery import Delivery
from skyway_gateway.deliveries.lifecycle.progress import Progress
from skyway_gateway.deliveries.records import delivery_store
from skyway_gateway.deliveries.records.stored_delivery import Known, Outdated, Queued
from skyway_gateway.deliveries.records.write_delivery import DeliveryWriter

log = logging.getLogger(__name__)

#: Wall seconds until a delivery that could not be booked is tried again, the least and the most.
_RETRY_S: Final = (0.5, 3.0)


@dataclass(frozen=True, slots=True)
class Booker:
    """Books queued deliveries, which it claims as `claimant`."""

    db: Database
    registry: Registry
    composition: Composition
    #: Ends a cancellation that was begun and not ended.
    finish_cancelling: Callable[[Delivery], Awaitable[None]]
    writer: DeliveryWriter
    clock: FleetClock
    mint: Mint
    claimant: str
    chance: random.Random = field(default_factory=random.SystemRandom)

    async def claim(self, *, limit: int) -> Sequence[Queued]:
        """Deliveries whose booking is due, the longest waiting first, now ours to book."""
        return await claim_queued(
            self.db,
            limit=limit,
            claimant=self.claimant,
            clock=self.clock,
            known=self.writer.known,
        )

    async def hold(self, deliveries: Collection[DeliveryId]) -> None:
        """Go on holding those of these deliveries that are still ours to book."""
        await hold(self.db, deliveries, claimant=self.claimant, clock=self.clock)

    async def book_or_retry(self, queued: Queued) -> None:
        """One round; what cannot be asked now is put off."""
        with tracing(queued.traceparent):
            try:
                await self.book(queued)
            except (ServiceUnavailable, RemoteProblem) as trouble:
                about = {"delivery_id": queued.delivery.delivery_id, "reason": str(trouble)}
                log.warning("booking put off", extra=about)
                await self._try_later(queued.delivery, reasons=None)

    async def book(self, queued: Queued) -> None:
        """One round: what waits is planned, waits for another round, or is given up."""
        delivery = queued.delivery
        if delivery.cancel_reason is not None:  # whoever cancelled it died before the end
            await self.finish_cancelling(delivery)
            return
        if most_refused(delivery):
            await self._give_up(queued.known, (), detail="too many drones refused to fly it")
            return
        if self.clock.now() >= queued.give_up_at:
            detail = f"no drone could be booked before {queued.give_up_at:%Y-%m-%dT%H:%M:%SZ}"
            await self._give_up(queued.known, delivery.reasons, detail=detail)
            return
        candidates = await self.registry.candidates(candidate_query(queued))
        # Asked even without candidates: an earlier round may have booked this attempt and died.
        wanted = wanted_missions(delivery, candidates.shortlist)
        booking = await self.composition.book(delivery.delivery_id, wanted)
        await self._decide(queued.known, booking, candidates)

    async def _decide(self, known: Known, booking: Booking, candidates: Candidates) -> None:
        delivery = known.delivery
        reasons = (*booking.reasons, *candidates.infeasible)
        if booking.outcome == "BOOKED":
            await self._plan(known, booking.missions)
        elif booking.outcome == "CLOSED":  # an earlier round decided to give it up, and died
            await self._give_up(known, delivery.reasons, detail="no provider can fly it")
        elif never := why_never(delivery.offer, booking, candidates):
            await self._give_up(known, never.reasons, detail=never.detail)
        else:
            await self._try_later(delivery, reasons=reasons)

    async def _plan(self, known: Known, missions: Sequence[Mission]) -> None:
        """Plan what was booked, unless another replica was faster."""
        try:
            async with self.db.write() as tx:
                self._write_plan(tx, known, missions)
        except Outdated:  # cancelled meanwhile, or planned by another replica
            async with self.db.write() as tx:
                now = await delivery_store.lock(tx, known.delivery.delivery_id)
                if now.delivery.attempt == known.delivery.attempt:
                    self._write_plan(tx, now, missions)

    def _write_plan(self, tx: Tx, known: Known, missions: Sequence[Mission]) -> None:
        """Packages that were cancelled while it was booked are called off again."""
        delivery = known.delivery
        if delivery.is_queued:
            planned = after_booking(delivery, missions, at=self.clock.now())
            self.writer.keep(tx, known, planned)
        if package_ids := unwanted(delivery, missions):
            asked = CancelMissions(
                cancellation_id=self.mint("cxl"),
                package_ids=package_ids,
                reason="cancelled while it was booked",
            )
            path = CANCELLATIONS_PATH.format(delivery_id=delivery.delivery_id)
            tx.report("composition", path, asked, stream=delivery.delivery_id)

    async def _give_up(
        self, known: Known, reasons: Sequence[ProviderReason], *, detail: str
    ) -> None:
        """Have nothing booked any more (the tombstone), and only then say so."""
        delivery = known.delivery
        refused = refusal_reasons(delivery.refusals)
        reasons = (*refused, *(reason for reason in reasons if reason not in refused))
        reasons = reasons or (nobody_asked(detail),)
        # Kept first: a round that finds the tombstone of a dead one still knows why.
        async with self.db.write() as tx:
            await delivery_store.note_reasons(tx, delivery.delivery_id, reasons)
        closed = await self.composition.close(delivery.delivery_id)
        booked = [one for one in closed.missions if one.attempt == delivery.attempt]
        if booked:  # an earlier round booked it after all
            await self._plan(known, booked)
        elif closed.is_closed or _knows(delivery, closed.missions):
            await self._write_given_up(delivery, reasons, detail=detail)
        else:  # a refused mission that composition has not freed yet
            await self._try_later(delivery, reasons=reasons)

    async def _write_given_up(
        self, delivery: Delivery, reasons: Sequence[ProviderReason], *, detail: str
    ) -> None:
        def give_up(now: Delivery) -> Progress | None:
            # Who cancels it meanwhile has closed it too, and is about to say CANCELLED.
            if now.attempt != delivery.attempt or now.cancel_reason is not None:
                return None
            return after_giving_up(now, reasons, detail=detail, at=self.clock.now())

        await self.writer.write(delivery.delivery_id, change=give_up)

    async def _try_later(
        self, delivery: Delivery, *, reasons: Sequence[ProviderReason] | None
    ) -> None:
        """Leave it in the queue; what the last round learned is shown to the customer."""
        wait_s = self.chance.uniform(*_RETRY_S)
        next_try_at = self.clock.wall_now() + timedelta(seconds=wait_s)
        async with self.db.write() as tx:
            await try_later(tx, delivery.delivery_id, next_try_at=next_try_at, reasons=reasons)


def _knows(delivery: Delivery, missions: Sequence[Mission]) -> bool:
    """Whether these are missions of the delivery's other packages."""
    known = {mission.mission_id for mission in delivery.live_missions}
    return all(mission.mission_id in known for mission in missions)
