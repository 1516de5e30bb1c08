"""Accepts delivery requests and offers: each is checked against network and fleets, then written.

The row is the queue: once it is written, booking finds it, even if this process dies.
"""

from dataclasses import dataclass
from datetime import datetime, timedelta
from functools import partial

from skyway.contracts.candidate import ProviderReason
from skyway.contracts.delivery_event import DeliveryEventType
from skyway.contracts.delivery_event_data import Custodian
from skyway.contracts.mission import OfferHold, OfferLimits
from skyway.delivery.request import DeliveryRequest
from skyway.errors import SkywayError
from skyway.geo import Position
from skyway.ids import DeliveryId, SubjectId, kind_for
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import Conflict, NotFound
from skyway.runtime.http.identity import Caller
from skyway.runtime.idempotency_store import Answer, KeyedCall, answered_before, once
from skyway.runtime.minting import Mint
from skyway.runtime.sql.claims import FREE
from skyway.runtime.sql.database import Database, Tx
from skyway.runtime.tracing import current_traceparent
from skyway.units import moment_to_ms
from skyway_gateway.deliveries.booking.queue_store import held_by
from skyway_gateway.deliveries.booking.run_bookings import BookingLoop, books_from
from skyway_gateway.deliveries.lifecycle import event_data
from skyway_gateway.deliveries.lifecycle.booking_effects import give_up_at
from skyway_gateway.deliveries.lifecycle.customer_forms import (
    NewDelivery,
    OfferChoice,
    RequestedDelivery,
)
from skyway_gateway.deliveries.lifecycle.delivery import Delivery, Flags, PackageStatus
from skyway_gateway.deliveries.proving.photos import Photos
from skyway_gateway.deliveries.records.delivery_rows import QueuedDelivery, StoredDelivery
from skyway_gateway.deliveries.records.write_delivery import DeliveryWriter
from skyway_gateway.deliveries.requests.quota_store import DeliveryQuota
from skyway_gateway.notifications.delivery_events import Happening
from skyway_gateway.personal_data import store as personal_data
from skyway_gateway.personal_data.details import NO_DATA, PersonalData, require_packages
from skyway_gateway.places.serve import PlaceServer
from skyway_gateway.places.served import ServedPlace
from skyway_gateway.proofs import store as proof_store
from skyway_gateway.proofs.verification import CustomerVerification
from skyway_gateway.quotes.accept_offer import OfferKeeper, accept_offer
from skyway_gateway.quotes.check_request import CheckedRequest, RequestChecks
from skyway_gateway.quotes.store import hold_of, one_of
from skyway_gateway.tracking_links import FIRST_LINK, TrackingLinks


def new_delivery(
    delivery_id: DeliveryId,
    *,
    customer_id: SubjectId,
    request: DeliveryRequest,
    offer: OfferLimits | None,
    reasons: tuple[ProviderReason, ...] = (),
    is_scheduled: bool = False,
    at: datetime,
) -> Delivery:
    """The delivery of a request that was just accepted: its packages are at the pickup."""
    pickup = Custodian(kind="STATION", id=request.pickup.station_id)
    return Delivery(
        delivery_id=delivery_id,
        customer_id=customer_id,
        state="SCHEDULED" if is_scheduled else "REQUESTED",
        activity=None,
        flags=Flags(),
        reference=request.reference,
        request=request,
        created_at=at,
        updated_at=at,
        attempt=1,
        price=None,
        provider_id=None,
        missions=(),
        packages=tuple(
            PackageStatus(
                package_id=package.package_id,
                state="CREATED",
                destination=package.destination,
                mass_kg=package.mass_kg,
                custodian=pickup,
            )
            for package in request.packages
        ),
        refusals=(),
        reasons=reasons,
        offer=offer,
    )


@dataclass(frozen=True, slots=True)
class _Checked:
    """A request that may be accepted, its places, and what composition holds for its offer.

    A hold that `is_new` was made for this call, not for the quote.
    """

    request: CheckedRequest
    places: tuple[ServedPlace, ...] = ()
    hold: OfferHold | None = None
    is_new: bool = False


@dataclass(frozen=True, slots=True)
class Acceptance:
    """Accepts requests and hands them to the booking loop."""

    db: Database
    places: PlaceServer
    checks: RequestChecks
    keeper: OfferKeeper
    writer: DeliveryWriter
    clock: FleetClock
    mint: Mint
    booking: BookingLoop
    horizon: timedelta
    quota: DeliveryQuota
    links: TrackingLinks
    #: How long personal data is kept after the end of its delivery.
    personal_kept: timedelta
    photos: Photos

    async def accept(
        self,
        caller: Caller,
        requested: NewDelivery | OfferChoice,
        call: KeyedCall,
    ) -> Answer:
        """202 with the delivery, which is written together with its first event.

        Raises
        ------
        InvalidInput
            A field is impossible now: an unknown station, too heavy, a deadline in the past.
        NotFound
            There is no such quote or offer, or it is not the caller's.
        Conflict
            QUOTE_TAKEN, QUOTE_EXPIRED: the offer can no longer be accepted. OFFER_LOST: its drone
            or pads are gone; nothing is written. TOO_MANY_DELIVERIES, TOO_MANY_SCHEDULED: the
            customer has as many as it may have.
        ServiceUnavailable
            Composition does not answer now, and never said whether the stations exist. For an
            offer: registry or composition do not answer now.
        """
        if isinstance(requested, OfferChoice):
            # A repeated call must not hold other drones.
            before = await answered_before(self.db, call, clock=self.clock)
            if before is not None:
                return before
        try:
            checked: _Checked | SkywayError = await self._check(caller, requested)
        except SkywayError as refusal:
            # First look whether this call was accepted before: a deadline that has passed
            # meanwhile, or a service that is away, must not change that answer.
            checked = refusal
        written: list[DeliveryId] = []

        async def write(tx: Tx) -> Answer:
            has_key = call.key is not None
            delivery = await self._write(tx, caller, requested, checked, has_key=has_key)
            tx.after_commit(lambda: written.append(delivery.delivery_id))
            location = {"Location": f"/v1/deliveries/{delivery.delivery_id}"}
            url = self.links.url_of(delivery.delivery_id, number=FIRST_LINK)
            shown = RequestedDelivery.model_construct(**dict(delivery), tracking_url=url)
            return Answer(202, shown.model_dump_json().encode(), location)

        try:
            answer = await once(self.db, call, act=write, clock=self.clock)
        except (Conflict, NotFound):
            await self._release(caller, requested, checked)
            raise
        if not written:
            await self._release(caller, requested, checked)
        return answer

    async def _check(self, caller: Caller, requested: NewDelivery | OfferChoice) -> _Checked:
        if isinstance(requested, NewDelivery):
            served = await self.places.serve(requested, who=str(caller))
            return _Checked(await self.checks.check(served.nearest), places=served.places)
        async with self.db.read() as connection:
            quote = await one_of(connection, caller, requested.quote_id)
            hold_id = await hold_of(connection, requested.quote_id)
        offer = quote.offers[quote.number_of(requested.offer_id)]
        checked = await self.checks.check(quote.request_of(offer))
        places = quote.places_of(offer)
        if self._books_later(quote.request, self.clock.now()) is not None:
            return _Checked(checked, places)
        hold = await self.keeper.keep(
            caller, quote, requested.offer_id, checked=checked, hold_id=hold_id
        )
        is_new = hold is not None and hold.hold_id != hold_id
        return _Checked(checked, places, hold, is_new=is_new)

    async def _release(
        self,
        caller: Caller,
        requested: NewDelivery | OfferChoice,
        checked: _Checked | SkywayError,
    ) -> None:
        """Give up what was held for an offer that nobody has accepted after all.

        The hold of a quote stays: another call may have accepted one of its offers.
        """
        if not isinstance(requested, OfferChoice) or not isinstance(checked, _Checked):
            return
        if checked.hold is None or not checked.is_new:
            return
        async with self.db.read() as connection:
            quote = await one_of(connection, caller, requested.quote_id)
        if quote.taken_offer_id != requested.offer_id:
            await self.keeper.release(checked.hold)

    async def _write(
        self,
        tx: Tx,
        caller: Caller,
        requested: NewDelivery | OfferChoice,
        checked: _Checked | SkywayError,
        *,
        has_key: bool,
    ) -> Delivery:
        now, kind = self.clock.now(), kind_for(caller.subject_id, "dlv")
        delivery_id = DeliveryId(self.mint(kind))
        offer = None
        if isinstance(requested, OfferChoice):
            chosen = await accept_offer(
                tx,
                caller,
                requested.quote_id,
                requested.offer_id,
                delivery_id=delivery_id,
                hold=None if isinstance(checked, SkywayError) else checked.hold,
                wall_now=self.clock.wall_now(),
            )
            offer = chosen.limits
        if isinstance(checked, SkywayError):
            raise checked
        delivery = new_delivery(
            delivery_id,
            customer_id=SubjectId(caller.subject_id),
            request=checked.request.request,
            offer=offer,
            reasons=checked.request.reasons,
            is_scheduled=self._books_later(checked.request.request, now) is not None,
            at=now,
        )
        is_scheduled = delivery.state == "SCHEDULED"
        await self.quota.admit(tx, delivery.customer_id, is_scheduled=is_scheduled)
        self._add(tx, delivery, checked.request.pickup_position, has_key=has_key)
        self._add_personal(tx, delivery, requested, checked.places)
        self._add_proofs(tx, delivery, requested)
        return delivery

    def _add_proofs(self, tx: Tx, delivery: Delivery, requested: NewDelivery | OfferChoice) -> None:
        """Add the proofs that are asked for. The PINs of an offer are made."""
        if not delivery.request.needs_proof:
            return
        asked = {
            each.package_id: CustomerVerification(method=planned.method)
            for each in delivery.request.packages
            if (planned := each.dropoff_verification) is not None
        }
        for number, each in enumerate(delivery.request.packages):
            if each.package_id in asked and asked[each.package_id].method == "PHOTO":
                self.photos.require_store(f"packages.{number}.dropoff_verification.method")
        if isinstance(requested, NewDelivery):
            given = ((each.package_id, each.dropoff_verification) for each in requested.packages)
            asked |= {package_id: each for package_id, each in given if each is not None}
        proof_store.add(tx, delivery.delivery_id, asked)

    def _add_personal(
        self,
        tx: Tx,
        delivery: Delivery,
        requested: NewDelivery | OfferChoice,
        places: tuple[ServedPlace, ...],
    ) -> None:
        """Add what the customer says about people and places, if anything."""
        named = (each.package_id for each in requested.packages)
        require_packages(named, (each.package_id for each in delivery.packages))
        data = PersonalData.of(requested, requested.packages, places=places)
        if data != NO_DATA:
            personal_data.add(
                tx,
                delivery.delivery_id,
                data,
                created_at=delivery.created_at,
                kept=self.personal_kept,
            )

    def _add(self, tx: Tx, delivery: Delivery, pickup: Position, *, has_key: bool) -> None:
        """Add the delivery with its first events, and begin to book it after the commit."""
        accepted = QueuedDelivery(
            StoredDelivery(delivery, traceparent=current_traceparent()),
            pickup,
            give_up_at(delivery.request, self.clock),
            has_idempotency_key=has_key,
            network_id=self.checks.networks.network_of(delivery.request.pickup.station_id),
            woken_wall_ms=moment_to_ms(self.clock.wall_now()),
        )
        is_ours = delivery.is_queued and self.booking.is_free
        claim = held_by(self.booking.claimant, self.clock) if is_ours else FREE
        queued = self.writer.add(tx, accepted, self._first_events(delivery), claim=claim)
        if delivery.is_queued:
            tx.after_commit(self.booking.note_accepted)
        if is_ours:
            tx.after_commit(partial(self.booking.begin, queued))
        elif delivery.is_queued:
            tx.after_commit(self.booking.queued.set)

    def _first_events(self, delivery: Delivery) -> list[Happening]:
        request, at = delivery.request, delivery.created_at
        first = [Happening(DeliveryEventType.REQUESTED, at, event_data.requested(delivery))]
        later_at = self._books_later(request, at)
        first_at = request.first_hand_over_at
        if later_at is not None and first_at is not None:
            data = event_data.scheduled(first_at, books_from_at=later_at)
            first.append(Happening(DeliveryEventType.SCHEDULED, at, data))
        return first

    def _books_later(self, request: DeliveryRequest, now: datetime) -> datetime | None:
        """From when a drone may be booked, if the pickup is beyond the horizon; else None."""
        books_from_at = books_from(request, self.horizon)
        return None if books_from_at is None or books_from_at <= now else books_from_at
