"""Accepting a delivery request: checked against the world, then written once.

The row is the queue: once it is written, `book` finds it, whoever dies meanwhile.
"""

from dataclasses import dataclass
from functools import partial

from skyway.contracts.delivery_event import DeliveryEventType
from skyway.delivery.request import DeliveryRequest
from skyway.errors import SkywayError
from skyway.geo import Position
from skyway.ids import DeliveryId, SubjectId
from skyway.runtime.clock import FleetClock
from skyway.runtime.http.identity import Caller
from skyway.runtime.idempotency.answer import Answer
from skyway.runtime.idempotency.once import once
from skyway.runtime.minting import Mint
from skyway.runtime.sql.claims import FREE
from skyway.runtime.sql.database import Database, Tx
from skyway.runtime.tracing import current_traceparent
from skyway_gateway.deliveries.accepting.new_delivery import OfferChoice, new_delivery
from skyway_gateway.deliveries.booking.queue_store import held_by
from skyway_gateway.deliveries.booking.run_bookings import BookingLoop
from skyway_gateway.deliveries.lifecycle import event_data
from skyway_gateway.deliveries.lifecycle.booking_deadline import give_up_at
from skyway_gateway.deliveries.lifecycle.delivery import Delivery
from skyway_gateway.deliveries.records.stored_delivery import Known, Queued
from skyway_gateway.deliveries.records.write_delivery import DeliveryWriter
from skyway_gateway.notifications.record_events import Happening
from skyway_gateway.quotes.accept_offer import take
from skyway_gateway.quotes.check_request import Checks
from skyway_gateway.quotes.store import one_of


@dataclass(frozen=True, slots=True)
class _Checked:
    """A request that the world allows, and where its pickup is."""

    request: DeliveryRequest
    position: Position


@dataclass(frozen=True, slots=True)
class Acceptance:
    """Accepts requests, and hands them to the loop that books them."""

    db: Database
    checks: Checks
    writer: DeliveryWriter
    clock: FleetClock
    mint: Mint
    booking: BookingLoop

    async def accept(
        self,
        caller: Caller,
        wanted: DeliveryRequest | OfferChoice,
        *,
        idempotency_key: str | None,
        body: bytes,
    ) -> Answer:
        """202 with the delivery, written together with its first event.

        Raises
        ------
        InvalidInput
            A field breaks a limit of the world: an unknown station, too heavy, too late.
        NotFound
            There is no such quote or offer, or it is not the caller's.
        Conflict
            QUOTE_TAKEN, QUOTE_EXPIRED: the offer cannot be taken any more.
        ServiceUnavailable
            The world cannot be asked now.
        """
        try:
            checked: _Checked | SkywayError = await self._check(caller, wanted)
        except SkywayError as refusal:
            # Answered only after looking whether this very call was accepted before: a deadline
            # that has passed meanwhile, or a service that is away, must not change that answer.
            checked = refusal

        async def keep(tx: Tx) -> Answer:
            delivery = await self._keep(tx, caller, wanted, checked)
            location = {"Location": f"/v1/deliveries/{delivery.delivery_id}"}
            return Answer(202, delivery.model_dump_json().encode(), location)

        return await once(
            self.db,
            caller=str(caller),
            route="POST /v1/deliveries",
            key=idempotency_key,
            body=body,
            act=keep,
            clock=self.clock,
        )

    async def _check(self, caller: Caller, wanted: DeliveryRequest | OfferChoice) -> _Checked:
        if isinstance(wanted, DeliveryRequest):
            return _Checked(wanted, await self.checks.check(wanted))
        async with self.db.read() as connection:
            quote = await one_of(connection, caller, wanted.quote_id)
        return _Checked(quote.request, await self.checks.check(quote.request))

    async def _keep(
        self,
        tx: Tx,
        caller: Caller,
        wanted: DeliveryRequest | OfferChoice,
        checked: _Checked | SkywayError,
    ) -> Delivery:
        now, delivery_id = self.clock.now(), DeliveryId(self.mint("dlv"))
        offer = None
        if isinstance(wanted, OfferChoice):
            taken = await take(
                tx,
                caller,
                wanted.quote_id,
                wanted.offer_id,
                delivery_id=delivery_id,
                wall_now=self.clock.wall_now(),
            )
            offer = taken.limits
        if isinstance(checked, SkywayError):
            raise checked
        request, customer_id = checked.request, SubjectId(caller.subject_id)
        delivery = new_delivery(
            delivery_id, customer_id=customer_id, request=request, offer=offer, at=now
        )
        give_up = give_up_at(request, self.clock)
        requested = Happening(DeliveryEventType.REQUESTED, now, event_data.requested(delivery))
        known = Known(delivery, version=1, last_sequence=1)
        queued = Queued(known, checked.position, give_up, current_traceparent())
        is_ours = self.booking.is_free
        claim = held_by(self.booking.claimant, self.clock) if is_ours else FREE
        self.writer.add(tx, queued, requested, claim=claim)
        tx.after_commit(partial(self.booking.begin, queued) if is_ours else self.booking.queued.set)
        return delivery
