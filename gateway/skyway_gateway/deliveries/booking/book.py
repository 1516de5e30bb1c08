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
from datetime import datetime
from functools import partial

from skyway.contracts.candidate import CandidateQueries, ProviderReason
from skyway.contracts.mission import Booking, BookMissions, Mission
from skyway.contracts.shortlist import Candidates, Shortlist
from skyway.ids import DeliveryId, is_live_id
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import RemoteProblem, ServiceUnavailable
from skyway.runtime.loops import MissingParts
from skyway.runtime.metrics import timed
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Database
from skyway.runtime.tracing import tracing
from skyway.units import ms_to_moment
from skyway_gateway.clients import DeliveryComposition, Registry
from skyway_gateway.deliveries.booking.booking_round import (
    AnswerLost,
    are_live,
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
    read_queued,
    try_later,
    wait_longer,
)
from skyway_gateway.deliveries.booking.wake_waiting import Waker, next_try_at, retry_at
from skyway_gateway.deliveries.lifecycle.booking_effects import (
    after_giving_up,
    give_up_again_at,
)
from skyway_gateway.deliveries.lifecycle.delivery import Delivery
from skyway_gateway.deliveries.lifecycle.progress import Progress, changed
from skyway_gateway.deliveries.records import delivery_store
from skyway_gateway.deliveries.records.delivery_rows import Outdated, QueuedDelivery
from skyway_gateway.deliveries.records.write_delivery import DeliveryWriter
from skyway_gateway.lateness.lateness_forecast import LatenessForecast, conditions_of
from skyway_gateway.livemode import ByMode
from skyway_gateway.proofs.upload_links import UploadLinks

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Booker:
    """Books queued deliveries, which it claims in the name of `claimant`."""

    db: Database
    registries: ByMode[Registry]
    composition: DeliveryComposition
    #: Ends a cancellation that was begun and not ended.
    finish_cancelling: Callable[[Delivery], Awaitable[None]]
    writer: DeliveryWriter
    clock: FleetClock
    mint: Mint
    claimant: str
    waker: Waker
    forecast: LatenessForecast
    uploads: UploadLinks
    chance: random.Random = field(default_factory=random.SystemRandom)
    missing: MissingParts = field(default_factory=lambda: MissingParts("booking"))

    async def claim(self, *, limit: int) -> Sequence[QueuedDelivery]:
        """Claim deliveries whose booking is due, the longest waiting first."""
        return await claim_queued(
            self.db, limit=limit, claimant=self.claimant, clock=self.clock, cache=self.writer.cache
        )

    async def hold(self, deliveries: Collection[DeliveryId]) -> None:
        """Renew our claims of these deliveries, as far as they are still ours."""
        await hold(self.db, deliveries, claimant=self.claimant, clock=self.clock)

    async def candidates_of(
        self, line: Sequence[QueuedDelivery]
    ) -> Mapping[DeliveryId, Candidates]:
        """Candidates for all live requests of a line, from one state of the fleets.

        So a drone that comes online meanwhile is a candidate for all of them, or for none. Empty if
        the registry is away: then each round asks again, and postpones its delivery.
        """
        line = [queued for queued in line if is_live_id(queued.delivery.delivery_id)]
        if not line:
            return {}
        asked = CandidateQueries(queries=tuple(candidate_query(queued) for queued in line))
        try:
            found = await self.registries.live.candidate_lists(asked)
        except (ServiceUnavailable, RemoteProblem):
            return {}
        ids = (queued.delivery.delivery_id for queued in line)
        return dict(zip(ids, found.answers, strict=True))

    async def book_or_retry(
        self, queued: QueuedDelivery, candidates: Candidates | None = None
    ) -> bool:
        """One round, and whether it has asked; if a service is away, the next one comes later."""
        round_time = timed("skyway_booking_round_duration_seconds", "time of a round of booking")
        with tracing(queued.traceparent, "book"), round_time:
            try:
                has_asked = await self.book(queued, candidates)
                self.missing.are_back()
            except (ServiceUnavailable, RemoteProblem) as trouble:
                if not self.missing.note(trouble):
                    about = {"delivery_id": queued.delivery.delivery_id, "reason": str(trouble)}
                    log.warning("booking postponed", extra=about)
                lost_at = trouble.asked_at if isinstance(trouble, AnswerLost) else None
                await self._try_later(
                    queued.delivery,
                    reasons=None,
                    was_asked=isinstance(trouble, RemoteProblem),
                    # Composition may still book what it has not answered.
                    asked_at=queued.asked_at or lost_at,
                )
                return True
        return has_asked

    async def learn(self, delivery_id: DeliveryId) -> bool:
        """Write what composition has booked for a delivery; whether it has booked anything.

        A report about a mission that is not known here says that the answer to the booking is lost.
        """
        queued = await read_queued(self.db, delivery_id)
        if queued is None:
            return True
        return queued.delivery.cancel_reason is None and await self._is_booked(queued)

    async def _is_booked(self, queued: QueuedDelivery) -> bool:
        """Ask again without candidates, which plans nothing; a booking is written."""
        booking = await self._ask(queued, booking_request(queued.delivery, Shortlist()))
        if booking.outcome == "BOOKED":
            await self._plan(queued, booking.missions)
        return booking.outcome == "BOOKED"

    async def _ask(self, queued: QueuedDelivery, requested: BookMissions) -> Booking:
        asked_at, delivery_id = self.clock.wall_now(), queued.delivery.delivery_id
        asked = requested
        if asked.request.needs_proof:
            # Only this question has the addresses of photos: they are secrets.
            request = self.uploads.added_to(asked.request, delivery_id)
            asked = asked.model_copy(update={"request": request})
        try:
            return await self.composition.book(delivery_id, asked)
        except ServiceUnavailable as trouble:
            raise AnswerLost(trouble, asked_at) from trouble

    async def book(self, queued: QueuedDelivery, candidates: Candidates | None = None) -> bool:
        """One round: the waiting packages are planned, wait for another round, or are given up.

        False if composition was not asked. Without `candidates` the registry is asked for them.
        """
        delivery = queued.delivery
        if delivery.cancel_reason is not None:  # the process that cancelled it died meanwhile
            await self.finish_cancelling(delivery)
            return False
        if has_too_many_refusals(delivery.refusals):
            await self._give_up(queued, (), detail="too many drones refused to fly it")
            return False
        if queued.asked_at is not None and await self._is_booked(queued):
            return True
        is_held = delivery.offer is not None and delivery.offer.hold is not None
        if not (queued.is_waiting or is_held) and self.waker.has_waiting(queued.network_id):
            await self._line_up(queued)
            return False
        is_over = self.clock.now() >= queued.give_up_at
        if is_over and delivery.request.latest_at is not None:
            await self._give_up_late(queued, delivery.reasons)
            return False
        registry = self.registries.of(delivery.customer_id)
        candidates = candidates or await registry.candidates(candidate_query(queued))
        # Ask even without candidates: an earlier round may have booked this attempt and died.
        booking = await self._ask(queued, booking_request(delivery, candidates.shortlist))
        await self._decide(queued, booking, candidates, is_last=is_over)
        return True

    async def _decide(
        self, queued: QueuedDelivery, booking: Booking, candidates: Candidates, *, is_last: bool
    ) -> None:
        delivery = queued.delivery
        if booking.outcome == "BOOKED":
            await self._plan(queued, booking.missions)
            if delivery.offer is not None and delivery.offer.hold is not None:
                # The other offers of its quote are held no longer.
                self.waker.note_change(queued.network_id)
        elif booking.outcome == "WITHDRAWN":  # a change of its request did not come to its end
            await self._begin_next_attempt(delivery)
        elif booking.outcome == "CLOSED":  # an earlier round gave it up, and died
            await self._give_up(queued, delivery.reasons, detail="no provider can fly it")
        elif infeasible := why_infeasible(delivery.offer, booking, candidates):
            await self._give_up(queued, infeasible.reasons, detail=infeasible.detail)
        elif is_last:
            await self._give_up_late(queued, reasons_of_round(booking, candidates))
        else:
            await self._wait(queued, reasons_of_round(booking, candidates))

    async def _begin_next_attempt(self, delivery: Delivery) -> None:
        def next_attempt(now: Delivery) -> Progress | None:
            is_same = now.attempt == delivery.attempt and now.is_queued
            return Progress(changed(now, attempt=now.attempt + 1)) if is_same else None

        await self.writer.write(delivery.delivery_id, change=next_attempt)

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
            plans = [conditions_of(each) for each in missions]
            share = self.forecast.late_share(queued.network_id, missions[0].provider_id, plans)
        at, save_plan = self.clock.now(), self.writer.save_plan
        write = partial(save_plan, missions=missions, late_share=share, at=at, mint=self.mint)
        try:
            async with self.db.write() as tx:
                write(tx, stored)
        except Outdated:  # cancelled meanwhile, or planned by another replica
            async with self.db.write() as tx:
                now = await delivery_store.lock(tx, stored.delivery.delivery_id)
                if now.delivery.attempt == stored.delivery.attempt:
                    write(tx, now)

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
        elif closed.is_closed or are_live(delivery, closed.missions):
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
        asked_at: datetime | None = None,
    ) -> None:
        """Leave it in the queue; the customer sees the reasons of this round.

        If registry or composition could not be asked, the waiting time starts again.
        """
        next_try_at = retry_at(self.clock.wall_now(), asked_at=asked_at, chance=self.chance)
        give_up = None if was_asked else give_up_again_at(delivery, self.clock)
        async with self.db.write() as tx:
            await try_later(
                tx,
                delivery.delivery_id,
                next_try_at=next_try_at,
                reasons=reasons,
                give_up_at=give_up,
                asked_at=asked_at,
            )
