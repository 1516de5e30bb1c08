"""Books missions for a delivery with packages that wait, one round at a time.

A round asks the registry for candidates, asks composition to book the best plan, and writes the
result. The process may be killed between any two lines: the row is still in the queue, and the next
round asks again. That is safe, because composition always answers the same (delivery, attempt) with
the same missions.
"""

import logging
import random
from collections.abc import Awaitable, Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import timedelta
from typing import Final

from skyway.contracts.candidate import CandidateQueries, ProviderReason
from skyway.contracts.mission import Booking, CancelMissions, Mission
from skyway.contracts.shortlist import Candidates
from skyway.ids import DeliveryId
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import RemoteProblem, ServiceUnavailable
from skyway.runtime.loops import MissingParts
from skyway.runtime.metrics import timed
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Database, Tx
from skyway.runtime.tracing import tracing
from skyway.units import ms_to_moment
from skyway_gateway.clients import CANCELLATIONS_PATH, Composition, Registry
from skyway_gateway.deliveries.booking.booking_round import (
    booking_request,
    candidate_query,
    has_too_many_refusals,
    no_reason_given,
    not_in_time,
    reasons_of_round,
    refusal_reasons,
    why_infeasible,
)
from skyway_gateway.deliveries.booking.queue_store import (
    claim_queued,
    hold,
    line_up,
    note_reasons,
    try_later,
    wait_longer,
)
from skyway_gateway.deliveries.booking.wake_waiting import Waker, next_try_at
from skyway_gateway.deliveries.lifecycle.booking_effects import (
    after_booking,
    after_giving_up,
    cancelled_meanwhile,
    give_up_again_at,
)
from skyway_gateway.deliveries.lifecycle.delivery import Delivery
from skyway_gateway.deliveries.lifecycle.progress import Progress
from skyway_gateway.deliveries.records import delivery_store
from skyway_gateway.deliveries.records.stored_delivery import (
    Outdated,
    QueuedDelivery,
    StoredDelivery,
)
from skyway_gateway.deliveries.records.write_delivery import DeliveryWriter
from skyway_gateway.lateness.lateness_forecast import LatenessForecast

log = logging.getLogger(__name__)

#: Wall seconds until the next round after one that could not ask: least and most.
_RETRY_S: Final = (0.5, 3.0)


@dataclass(frozen=True, slots=True)
class Booker:
    """Books queued deliveries, which it claims in the name of `claimant`."""

    db: Database
    registry: Registry
    composition: Composition
    #: Ends a cancellation that was begun and not ended.
    finish_cancelling: Callable[[Delivery], Awaitable[None]]
    writer: DeliveryWriter
    clock: FleetClock
    mint: Mint
    claimant: str
    waker: Waker
    forecast: LatenessForecast
    chance: random.Random = field(default_factory=random.SystemRandom)
    missing: MissingParts = field(default_factory=lambda: MissingParts("booking"))

    async def claim(self, *, limit: int) -> Sequence[QueuedDelivery]:
        """Claim deliveries whose booking is due, the longest waiting first."""
        return await claim_queued(
            self.db,
            limit=limit,
            claimant=self.claimant,
            clock=self.clock,
            cache=self.writer.cache,
        )

    async def hold(self, deliveries: Collection[DeliveryId]) -> None:
        """Renew our claims of these deliveries, as far as they are still ours."""
        await hold(self.db, deliveries, claimant=self.claimant, clock=self.clock)

    async def candidates_of(
        self, line: Sequence[QueuedDelivery]
    ) -> Mapping[DeliveryId, Candidates]:
        """Candidates for all requests of a line, from one state of the fleets.

        So a drone that comes online meanwhile is a candidate for all of them, or for none. Empty if
        the registry is away: then each round asks again, and postpones its delivery.
        """
        asked = CandidateQueries(queries=tuple(candidate_query(queued) for queued in line))
        try:
            found = await self.registry.candidate_lists(asked)
        except (ServiceUnavailable, RemoteProblem):
            return {}
        ids = (queued.delivery.delivery_id for queued in line)
        return dict(zip(ids, found.answers, strict=True))

    async def book_or_retry(
        self, queued: QueuedDelivery, candidates: Candidates | None = None
    ) -> None:
        """One round; if a service is away, the next round comes later."""
        round_time = timed("skyway_booking_round_duration_seconds", "time of a round of booking")
        with tracing(queued.traceparent, "book"), round_time:
            try:
                await self.book(queued, candidates)
                self.missing.are_back()
            except (ServiceUnavailable, RemoteProblem) as trouble:
                if not self.missing.note(trouble):
                    about = {"delivery_id": queued.delivery.delivery_id, "reason": str(trouble)}
                    log.warning("booking postponed", extra=about)
                await self._try_later(
                    queued.delivery, reasons=None, was_asked=isinstance(trouble, RemoteProblem)
                )

    async def book(self, queued: QueuedDelivery, candidates: Candidates | None = None) -> None:
        """One round: the waiting packages are planned, wait for another round, or are given up.

        Without `candidates` the registry is asked for them.
        """
        delivery = queued.delivery
        if delivery.cancel_reason is not None:  # the process that cancelled it died meanwhile
            await self.finish_cancelling(delivery)
            return
        if has_too_many_refusals(delivery.refusals):
            await self._give_up(queued, (), detail="too many drones refused to fly it")
            return
        is_held = delivery.offer is not None and delivery.offer.hold is not None
        if not (queued.is_waiting or is_held) and self.waker.has_waiting(queued.network_id):
            await self._line_up(queued)
            return
        is_over = self.clock.now() >= queued.give_up_at
        if is_over and delivery.request.latest_at is not None:
            await self._give_up_late(queued, delivery.reasons)
            return
        candidates = candidates or await self.registry.candidates(candidate_query(queued))
        # Ask even without candidates: an earlier round may have booked this attempt and died.
        requested = booking_request(delivery, candidates.shortlist)
        booking = await self.composition.book(delivery.delivery_id, requested)
        await self._decide(queued, booking, candidates, is_last=is_over)

    async def _decide(
        self, queued: QueuedDelivery, booking: Booking, candidates: Candidates, *, is_last: bool
    ) -> None:
        delivery = queued.delivery
        if booking.outcome == "BOOKED":
            await self._plan(queued, booking.missions)
            if delivery.offer is not None and delivery.offer.hold is not None:
                # The other offers of its quote are held no longer.
                self.waker.note_change(queued.network_id)
        elif booking.outcome == "CLOSED":  # an earlier round gave it up, and died
            await self._give_up(queued, delivery.reasons, detail="no provider can fly it")
        elif infeasible := why_infeasible(delivery.offer, booking, candidates):
            await self._give_up(queued, infeasible.reasons, detail=infeasible.detail)
        elif is_last:
            await self._give_up_late(queued, reasons_of_round(booking, candidates))
        else:
            await self._wait(queued, reasons_of_round(booking, candidates))

    async def _line_up(self, queued: QueuedDelivery) -> None:
        """Let a new request wait until those that wait already have been tried again.

        A drone may have become free a moment ago: it belongs to who asked first.
        """
        async with self.db.write() as tx:
            await line_up(tx, queued, now=self.clock.now())
        self.waker.note_change(queued.network_id)

    async def _wait(self, queued: QueuedDelivery, reasons: Sequence[ProviderReason]) -> None:
        """Leave it in the queue until something changes; the customer sees the reasons."""
        wall_now = self.clock.wall_now()
        later = next_try_at(woken_at=ms_to_moment(queued.woken_wall_ms), now=wall_now)
        async with self.db.write() as tx:
            await wait_longer(tx, queued, now=self.clock.now(), next_try_at=later, reasons=reasons)
        self.waker.note_waiting(queued.network_id)

    async def _plan(self, queued: QueuedDelivery, missions: Sequence[Mission]) -> None:
        """Write the booked missions, unless another replica has written them already."""
        stored = queued.stored
        offer = stored.delivery.offer
        share = None if offer is None else offer.late_share
        if share is None:
            margins = [each.margins for each in missions]
            share = self.forecast.late_share(queued.network_id, missions[0].provider_id, margins)
        try:
            async with self.db.write() as tx:
                self._write_plan(tx, stored, missions, share)
        except Outdated:  # cancelled meanwhile, or planned by another replica
            async with self.db.write() as tx:
                now = await delivery_store.lock(tx, stored.delivery.delivery_id)
                if now.delivery.attempt == stored.delivery.attempt:
                    self._write_plan(tx, now, missions, share)

    def _write_plan(
        self,
        tx: Tx,
        stored: StoredDelivery,
        missions: Sequence[Mission],
        late_share: float | None,
    ) -> None:
        """Write the missions; packages that were cancelled meanwhile are cancelled there too."""
        delivery = stored.delivery
        if delivery.is_queued:
            now = self.clock.now()
            planned = after_booking(delivery, missions, at=now, late_share=late_share)
            self.writer.save(tx, stored, planned)
        if package_ids := cancelled_meanwhile(delivery, missions):
            asked = CancelMissions(
                cancellation_id=self.mint("cxl"),
                package_ids=package_ids,
                reason="cancelled during booking",
            )
            path = CANCELLATIONS_PATH.format(delivery_id=delivery.delivery_id)
            tx.report("composition", path, asked, stream=delivery.delivery_id)

    async def _give_up_late(
        self, queued: QueuedDelivery, reasons: Sequence[ProviderReason]
    ) -> None:
        detail = not_in_time(queued.give_up_at, reasons)
        await self._give_up(queued, reasons, detail=detail)

    async def _give_up(
        self, queued: QueuedDelivery, reasons: Sequence[ProviderReason], *, detail: str
    ) -> None:
        """Close the delivery in composition, and only then write that it is given up."""
        delivery = queued.delivery
        refused = refusal_reasons(delivery.refusals)
        reasons = (*refused, *(reason for reason in reasons if reason not in refused))
        reasons = reasons or (no_reason_given(delivery.request, detail),)
        # Store the reasons first: if this process dies, the next round still has them.
        async with self.db.write() as tx:
            await note_reasons(tx, delivery.delivery_id, reasons)
        closed = await self.composition.close(delivery.delivery_id)
        booked = [one for one in closed.missions if one.attempt == delivery.attempt]
        if booked:  # an earlier round has booked it
            await self._plan(queued, booked)
        elif closed.is_closed or _are_live(delivery, closed.missions):
            await self._write_given_up(delivery, reasons, detail=detail)
        else:  # composition has not released a refused mission yet
            await self._try_later(delivery, reasons=reasons)

    async def _write_given_up(
        self, delivery: Delivery, reasons: Sequence[ProviderReason], *, detail: str
    ) -> None:
        def give_up(now: Delivery) -> Progress | None:
            # A cancellation that began meanwhile has closed it too, and will write CANCELLED.
            if now.attempt != delivery.attempt or now.cancel_reason is not None:
                return None
            return after_giving_up(now, reasons, detail=detail, at=self.clock.now())

        await self.writer.write(delivery.delivery_id, change=give_up)

    async def _try_later(
        self,
        delivery: Delivery,
        *,
        reasons: Sequence[ProviderReason] | None,
        was_asked: bool = True,
    ) -> None:
        """Leave it in the queue; the customer sees the reasons of this round.

        If registry or composition could not be asked, the waiting time starts again.
        """
        wait_s = self.chance.uniform(*_RETRY_S)
        next_try_at = self.clock.wall_now() + timedelta(seconds=wait_s)
        give_up = None if was_asked else give_up_again_at(delivery, self.clock)
        async with self.db.write() as tx:
            await try_later(
                tx,
                delivery.delivery_id,
                next_try_at=next_try_at,
                reasons=reasons,
                give_up_at=give_up,
            )


def _are_live(delivery: Delivery, missions: Sequence[Mission]) -> bool:
    """Whether all these missions fly other packages of the delivery now."""
    live = {mission.mission_id for mission in delivery.live_missions}
    return all(mission.mission_id in live for mission in missions)
