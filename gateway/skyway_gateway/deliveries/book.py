"""From a request to a booked mission: the loop over all deliveries in state REQUESTED.

Each round asks the registry who could fly, then composition to book the best plan, and writes
down what came of it. The process may be killed between any two lines: the row is still in the
queue, and the next round asks again. That is safe, because composition answers the same
(delivery, attempt) with the same missions for ever.
"""

import logging
import random
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import timedelta
from typing import Final

from skyway.contracts.candidate import CandidateQuery, Candidates, ProviderReason
from skyway.contracts.mission import Booking, BookMissions, Mission
from skyway.runtime.clock import FleetClock
from skyway.runtime.database import Database
from skyway.runtime.errors import RemoteProblem, ServiceUnavailable
from skyway.runtime.loops import Wake
from skyway.runtime.minting import Mint
from skyway.runtime.tracing import tracing
from skyway_gateway.clients import Composition, Registry
from skyway_gateway.deliveries import store
from skyway_gateway.deliveries.delivery import Delivery
from skyway_gateway.deliveries.progress import Progress, after_booking, after_rejection
from skyway_gateway.deliveries.rows import Queued
from skyway_gateway.deliveries.verdict import most_refused, nobody_asked, refusal_reasons, why_never
from skyway_gateway.notifications.events import Events

log = logging.getLogger(__name__)

#: Wall seconds until a delivery that could not be booked is tried again, the least and the most.
_RETRY_S: Final = (0.5, 3.0)


@dataclass(frozen=True, slots=True)
class Booker:
    """Books queued deliveries; `queued` is set when there is a new one."""

    db: Database
    registry: Registry
    composition: Composition
    events: Events
    clock: FleetClock
    mint: Mint
    queued: Wake
    chance: random.Random = field(default_factory=random.SystemRandom)

    async def step(self) -> bool:
        """Step of a loop: book the delivery that is due first; False when none is."""
        due = await store.claim_queued(
            self.db, limit=1, claimant=self.mint("bkr"), clock=self.clock
        )
        for queued in due:
            with tracing(queued.traceparent):
                await self._book_or_retry(queued)
        return bool(due)

    async def _book_or_retry(self, queued: Queued) -> None:
        try:
            await self.book(queued)
        except (ServiceUnavailable, RemoteProblem) as trouble:
            about = {"delivery_id": queued.delivery.delivery_id, "reason": str(trouble)}
            log.warning("booking put off", extra=about)
            await self._try_later(queued.delivery, reasons=None)

    async def book(self, queued: Queued) -> None:
        """One round: the delivery is planned, waits for another round, or is rejected."""
        delivery = queued.delivery
        if most_refused(delivery):
            await self._reject(delivery, (), detail="too many drones refused to fly it")
            return
        if self.clock.now() >= queued.give_up_at:
            detail = f"no drone could be booked before {queued.give_up_at:%Y-%m-%dT%H:%M:%SZ}"
            await self._reject(delivery, delivery.reasons, detail=detail)
            return
        candidates = await self.registry.candidates(_candidate_query(queued))
        # Asked even without candidates: an earlier round may have booked this attempt and died.
        booking = await self._ask_composition(delivery, candidates)
        reasons = (*booking.reasons, *candidates.infeasible)
        if booking.outcome == "BOOKED":
            await self._plan(delivery, booking.missions)
        elif booking.outcome == "CLOSED":  # an earlier round decided to reject it, and died
            await self._reject(delivery, delivery.reasons, detail="no provider can fly it")
        elif never := why_never(booking, candidates):
            await self._reject(delivery, reasons, detail=never)
        else:
            await self._try_later(delivery, reasons=reasons)

    async def _ask_composition(self, delivery: Delivery, candidates: Candidates) -> Booking:
        wanted = BookMissions(
            attempt=delivery.attempt,
            request=delivery.request,
            candidates=candidates.candidates,
        )
        return await self.composition.book(delivery.delivery_id, wanted)

    async def _plan(self, delivery: Delivery, missions: Sequence[Mission]) -> None:
        await self._write(delivery, after_booking(delivery, missions, at=self.clock.now()))

    async def _reject(
        self, delivery: Delivery, reasons: Sequence[ProviderReason], *, detail: str
    ) -> None:
        """Have nothing booked any more (the tombstone), and only then say REJECTED."""
        refused = refusal_reasons(delivery.refusals)
        reasons = (*refused, *(reason for reason in reasons if reason not in refused))
        reasons = reasons or (nobody_asked(detail),)
        # Kept first: a round that finds the tombstone of a dead one still knows why.
        async with self.db.write() as tx:
            await store.note_reasons(tx, delivery.delivery_id, reasons)
        closed = await self.composition.close(delivery.delivery_id)
        booked = [one for one in closed.missions if one.attempt == delivery.attempt]
        if closed.is_closed:
            rejected = after_rejection(delivery, reasons, detail=detail, at=self.clock.now())
            await self._write(delivery, rejected)
        elif booked:  # an earlier round booked it after all
            await self._plan(delivery, booked)
        else:  # a refused mission that composition has not freed yet
            await self._try_later(delivery, reasons=reasons)

    async def _write(self, delivery: Delivery, progress: Progress) -> None:
        """Write the delivery and its events, unless another replica was faster."""
        async with self.db.write() as tx:
            if await store.save(tx, delivery, progress.delivery):
                await self.events.tell(
                    tx,
                    progress.happenings,
                    delivery_id=delivery.delivery_id,
                    customer_id=delivery.customer_id,
                )

    async def _try_later(
        self, delivery: Delivery, *, reasons: Sequence[ProviderReason] | None
    ) -> None:
        """Leave it in the queue; what the last round learned is shown to the customer."""
        wait_s = self.chance.uniform(*_RETRY_S)
        next_try_at = self.clock.wall_now() + timedelta(seconds=wait_s)
        async with self.db.write() as tx:
            await store.try_later(
                tx, delivery.delivery_id, next_try_at=next_try_at, reasons=reasons
            )


def _candidate_query(queued: Queued) -> CandidateQuery:
    delivery = queued.delivery
    return CandidateQuery(
        pickup_station_id=delivery.request.pickup.station_id,
        pickup_position=queued.pickup_position,
        payload_kg=delivery.request.payload_kg,
        providers=delivery.request.qos.providers,
        excluded_drone_ids=tuple(refusal.drone_id for refusal in delivery.refusals),
    )
