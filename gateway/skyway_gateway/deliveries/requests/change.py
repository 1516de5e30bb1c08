"""Changes what a customer said about a delivery, and erases what it said about people.

Both lock the delivery first: two changes at the same time apply one after the other.
"""

from dataclasses import dataclass
from datetime import timedelta
from typing import Annotated, Final

from pydantic import Field

from skyway.contracts.delivery_event import DeliveryEventType
from skyway.contracts.message import FleetMoment
from skyway.contracts.mission import WithdrawMissions
from skyway.ids import DeliveryId
from skyway.json_model import JsonModel
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import Conflict
from skyway.runtime.http.identity import Caller
from skyway.runtime.loops import Wake
from skyway.runtime.sql.database import Database, Tx
from skyway_gateway.clients import DeliveryComposition
from skyway_gateway.deliveries.booking.run_bookings import books_from
from skyway_gateway.deliveries.lifecycle import event_data
from skyway_gateway.deliveries.lifecycle.booking_effects import give_up_at
from skyway_gateway.deliveries.lifecycle.changed_request import with_changed_request
from skyway_gateway.deliveries.lifecycle.customer_forms import ShownDelivery, shown_to
from skyway_gateway.deliveries.lifecycle.delivery import Delivery
from skyway_gateway.deliveries.lifecycle.progress import Progress, changed
from skyway_gateway.deliveries.proving.photos import Photos
from skyway_gateway.deliveries.records import delivery_store
from skyway_gateway.deliveries.records.write_delivery import DeliveryWriter
from skyway_gateway.deliveries.requests.change_form import DeliveryChange
from skyway_gateway.deliveries.requests.plan_change import ChangePlanner, PlannedChange
from skyway_gateway.notifications.delivery_events import Happening
from skyway_gateway.personal_data import store as personal_data
from skyway_gateway.personal_data.details import PersonalData, require_packages
from skyway_gateway.personal_data.store import StoredPersonalData
from skyway_gateway.proofs import store as proofs

#: How often a change is planned again because the delivery was booked or changed meanwhile.
_MOST_ATTEMPTS: Final = 3

#: In these states no drone may have its mission yet: composition knows.
_MAY_CHANGE: Final = ("SCHEDULED", "REQUESTED", "PLANNED", "DISPATCHED")


class ErasedPersonalData(JsonModel):
    """What a customer erased; what was erased is lost."""

    delivery_id: Annotated[DeliveryId, Field(description="The id of the delivery.")]
    erased_at: Annotated[
        FleetMoment | None,
        Field(description="When it was erased; null if there never was any personal data."),
    ]
    fields: Annotated[
        tuple[str, ...],
        Field(
            description="The names of what this call has erased, such as `recipient` and "
            "`packages.p1.instructions`."
        ),
    ]


@dataclass(frozen=True, slots=True)
class Changer:
    """Changes deliveries until their last hand-over, and erases personal data at any time."""

    db: Database
    planner: ChangePlanner
    composition: DeliveryComposition
    writer: DeliveryWriter
    clock: FleetClock
    horizon: timedelta
    #: How long personal data is kept after the end of its delivery.
    personal_kept: timedelta
    #: Wakes booking, which books a changed request.
    queued: Wake
    photos: Photos

    async def change(
        self, caller: Caller, delivery_id: DeliveryId, requested: DeliveryChange
    ) -> ShownDelivery:
        """The delivery after the change, which its events name without personal data.

        A change that changes nothing causes no event. If this process dies within a change of the
        request, the delivery is booked as it was requested before.

        Raises
        ------
        NotFound
            There is no such delivery, or it is not the caller's.
        InvalidInput
            It has no such package, would have too many members of metadata, or its request would be
            impossible.
        Conflict
            TOO_LATE: the delivery is over or being cancelled, the package is handed over or its
            proof is given, or a
            drone has the mission whose request is to be changed. SHARED_TRIP: its drone flies for
            others too. NO_OFFER: see `ChangePlanner`. CHANGED_MEANWHILE: another call has changed
            it.
        """
        for _ in range(_MOST_ATTEMPTS):
            async with self.db.read() as connection:
                seen = await delivery_store.one_of(connection, caller, delivery_id)
            _require_in_time(seen, requested)
            planned = await self.planner.plan(caller, seen, requested)
            if planned.names and seen.state not in _MAY_CHANGE:
                raise Conflict("TOO_LATE", f"it cannot be flown in another way: it is {seen.state}")
            if planned.names and not requested.dry_run and seen.state != "SCHEDULED":
                withdrawn = WithdrawMissions(attempt=seen.attempt)
                await self.composition.withdraw(delivery_id, withdrawn)
            shown = await self._write(caller, planned, requested)
            if shown is not None:
                return shown
        raise Conflict("CHANGED_MEANWHILE", "it was changed or booked meanwhile: try again")

    async def _write(
        self, caller: Caller, planned: PlannedChange, requested: DeliveryChange
    ) -> ShownDelivery | None:
        """Write the change; None if the request is not as it was when the change was planned."""
        delivery_id = planned.before.delivery_id
        async with self.db.write() as tx:
            before = await delivery_store.lock(tx, delivery_id)
            _require_in_time(before.delivery, requested)
            if planned.names and not _is_same(before.delivery, planned.before):
                return None
            personal = await personal_data.one_of(tx.connection, delivery_id)
            data = requested.applied_to(personal.data)
            if planned.names or planned.places:
                places = planned.places_after(data.places)
                data = data.model_copy(update={"places": places})
            names = [
                *_changed_fields(personal.data, data),
                *requested.new_pins(await proofs.of_delivery(tx.connection, delivery_id)),
            ]
            progress = self._progress(before.delivery, planned, requested, names=names)
            if not requested.dry_run and progress.happenings:
                created_at, kept = before.delivery.created_at, self.personal_kept
                if data != personal.data:
                    await personal_data.replace(
                        tx, delivery_id, data, created_at=created_at, kept=kept
                    )
                await self._replace_proofs(tx, before.delivery, requested)
                give_up = give_up_at(planned.request, self.clock) if planned.names else None
                self.writer.save(tx, before, progress, give_up_at=give_up)
                tx.after_commit(self.queued.set)
            found = await proofs.of_delivery(tx.connection, delivery_id)
        shown = personal if data == personal.data else StoredPersonalData(data)
        shown_delivery = shown_to(caller, _previewed(progress.delivery, planned))
        return ShownDelivery.of(shown_delivery, shown, found)

    async def _replace_proofs(self, tx: Tx, before: Delivery, requested: DeliveryChange) -> None:
        asked = {each.package_id: each.dropoff_verification for each in before.request.packages}
        found = await proofs.of_delivery(tx.connection, before.delivery_id)
        for each in requested.packages:
            if "dropoff_verification" not in each.model_fields_set:
                continue
            after, stored = each.proof_after(asked[each.package_id]), found.get(each.package_id)
            if stored is not None and stored.given_at is not None:
                detail = f"the proof of package {each.package_id} is given already"
                raise Conflict("TOO_LATE", detail)
            if after is not None and after.method == "PHOTO":
                self.photos.require_store("packages.dropoff_verification.method")
            # A PIN stays if the change does not name it.
            if each.gives_pin or after is None or stored is None or stored.method != after.method:
                await proofs.replace(tx, (before.delivery_id, each.package_id), after)

    def _progress(
        self,
        before: Delivery,
        planned: PlannedChange,
        requested: DeliveryChange,
        *,
        names: list[str],
    ) -> Progress:
        reference = before.reference
        if "reference" in requested.model_fields_set and requested.reference != reference:
            reference, names = requested.reference, [*names, "reference"]
        if not (names or planned.names):
            return Progress(before)
        at = max(self.clock.now(), before.updated_at)
        after = changed(before, reference=reference, updated_at=at)
        books_at = books_from(planned.request, self.horizon)
        is_ahead = books_at is not None and books_at > at
        if planned.names:
            after = with_changed_request(
                after, planned.request, offer=planned.offer, is_ahead=is_ahead, at=at
            )
        data = event_data.changed_by_customer(
            after, [*names, *planned.names], is_rescheduled=bool(planned.names)
        )
        happenings = [Happening(DeliveryEventType.CHANGED, at, data)]
        first_at = planned.request.first_hand_over_at
        if planned.names and is_ahead and first_at is not None and books_at is not None:
            scheduled = event_data.scheduled(first_at, books_from_at=books_at)
            happenings.append(Happening(DeliveryEventType.SCHEDULED, at, scheduled))
        return Progress(after, tuple(happenings))

    async def erase(self, caller: Caller, delivery_id: DeliveryId) -> ErasedPersonalData:
        """Erase all personal data of a delivery; erasing again changes nothing.

        Raises
        ------
        NotFound
            There is no such delivery, or it is not the caller's.
        """
        now = self.clock.now()
        async with self.db.write() as tx:
            await delivery_store.require_own(tx.connection, caller, delivery_id)
            await delivery_store.lock(tx, delivery_id)
            stored = await personal_data.one_of(tx.connection, delivery_id)
            await personal_data.erase(tx, delivery_id, at=now)
            pictures = await proofs.make_due(tx, delivery_id, at=now)
        # After a kill here, the loop erases the photos.
        await self.photos.erase_due()
        fields = (*sorted(stored.data.by_field()), *pictures)
        erased_at = now if fields else stored.erased_at
        return ErasedPersonalData(delivery_id=delivery_id, erased_at=erased_at, fields=fields)


def _is_same(now: Delivery, seen: Delivery) -> bool:
    """Whether the request and the booking attempt are those that were seen."""
    return (now.request, now.attempt, now.state) == (seen.request, seen.attempt, seen.state)


def _require_in_time(delivery: Delivery, requested: DeliveryChange) -> None:
    named = [each.package_id for each in requested.packages]
    require_packages(named, (each.package_id for each in delivery.packages))
    if delivery.is_over or delivery.cancel_reason is not None:
        state = delivery.state if delivery.is_over else "being cancelled"
        raise Conflict("TOO_LATE", f"nothing can be changed any more: the delivery is {state}")
    for package in delivery.packages:
        if package.package_id in named and package.is_settled:
            detail = f"package {package.package_id} cannot be changed: it is {package.state}"
            raise Conflict("TOO_LATE", detail)


def _previewed(delivery: Delivery, planned: PlannedChange) -> Delivery:
    """The delivery as the customer sees it: with the price that is offered for the change.

    Missions that were given up are gone.
    """
    missions = tuple(each for each in delivery.missions if each.state != "REFUSED")
    best, delivery = planned.preview, changed(delivery, missions=missions)
    if best is None:
        return delivery
    return changed(delivery, price=best.price, provider_id=best.provider_id)


def _changed_fields(before: PersonalData, after: PersonalData) -> list[str]:
    """The names of what differs."""
    old, new = before.by_field(), after.by_field()
    return sorted(name for name in old.keys() | new.keys() if old.get(name) != new.get(name))
