"""Changes what a customer said about a delivery, and erases what it said about people.

Both lock the delivery first: two changes at the same time apply one after the other.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import timedelta
from typing import Annotated, Any, Final

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from skyway.contracts.delivery_event import DeliveryEventType
from skyway.contracts.message import FleetMoment
from skyway.delivery.request import DeliveryRequest, Package
from skyway.ids import DeliveryId
from skyway.json_model import JsonModel
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import Conflict
from skyway.runtime.http.identity import Caller
from skyway.runtime.sql.database import Database
from skyway_gateway.deliveries.lifecycle import event_data
from skyway_gateway.deliveries.lifecycle.customer_forms import ShownDelivery, shown_to
from skyway_gateway.deliveries.lifecycle.delivery import Delivery
from skyway_gateway.deliveries.lifecycle.progress import Progress, changed
from skyway_gateway.deliveries.records import delivery_store
from skyway_gateway.deliveries.records.delivery_rows import StoredDelivery
from skyway_gateway.deliveries.records.write_delivery import DeliveryWriter
from skyway_gateway.notifications.delivery_events import Happening
from skyway_gateway.personal_data import store as personal_data
from skyway_gateway.personal_data.changes import PersonalDataChange
from skyway_gateway.personal_data.details import PersonalData, require_packages
from skyway_gateway.personal_data.store import StoredPersonalData

#: What decides how a delivery is flown: other values need another booking.
_BOOKED: Final = frozenset(DeliveryRequest.model_fields.keys() - {"packages", "reference"})
_BOOKED_OF_PACKAGE: Final = frozenset(Package.model_fields.keys() - {"package_id"})


class DeliveryChange(PersonalDataChange):
    """What is to be changed: a member that is left out stays, and null removes it."""

    reference: Annotated[
        Annotated[str, Field(max_length=200)] | None,
        Field(description="The customer's own word for it, up to 200 characters; null removes it."),
    ] = None
    dry_run: Annotated[
        bool,
        Field(description="Whether only to show the delivery as it would be after the change."),
    ] = False

    @model_validator(mode="before")
    @classmethod
    def _is_flown_alike(cls, given: Any) -> Any:  # any JSON value
        if isinstance(given, Mapping):
            packages = given.get("packages")
            of_packages = (
                f"packages.{number}.{name}"
                for number, each in enumerate(packages if isinstance(packages, list) else ())
                if isinstance(each, Mapping)
                for name in sorted(_BOOKED_OF_PACKAGE & each.keys())
            )
            if names := [*sorted(_BOOKED & given.keys()), *of_packages]:
                raise PydanticCustomError(
                    "booked",
                    "cannot change {names}: cancel the delivery, and request another one",
                    {"names": ", ".join(names[:5])},
                )
        return given


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
    writer: DeliveryWriter
    clock: FleetClock
    #: How long personal data is kept after the end of its delivery.
    personal_kept: timedelta

    async def change(
        self, caller: Caller, delivery_id: DeliveryId, requested: DeliveryChange
    ) -> ShownDelivery:
        """The delivery after the change, which its events name without the new values.

        A change that changes nothing causes no event.

        Raises
        ------
        NotFound
            There is no such delivery, or it is not the caller's.
        InvalidInput
            It has no such package, or would have too many members of metadata.
        Conflict
            TOO_LATE: the delivery is over or being cancelled, or the package is handed over.
        """
        async with self.db.write() as tx:
            await delivery_store.require_own(tx.connection, caller, delivery_id)
            before = await delivery_store.lock(tx, delivery_id)
            _require_in_time(before.delivery, requested)
            personal = await personal_data.one_of(tx.connection, delivery_id)
            data = requested.applied_to(personal.data)
            progress = self._progress(before, requested, names=_changed(personal.data, data))
            if not requested.dry_run and progress.happenings:
                if data != personal.data:
                    created_at, kept = before.delivery.created_at, self.personal_kept
                    await personal_data.replace(
                        tx, delivery_id, data, created_at=created_at, kept=kept
                    )
                self.writer.save(tx, before, progress)
        erased_at = personal.erased_at if data == personal.data else None
        shown = StoredPersonalData(data, erased_at)
        return ShownDelivery.of(shown_to(caller, progress.delivery), shown)

    def _progress(
        self, before: StoredDelivery, requested: DeliveryChange, *, names: list[str]
    ) -> Progress:
        delivery = before.delivery
        if "reference" in requested.model_fields_set:
            names += ["reference"] * (requested.reference != delivery.reference)
            delivery = changed(delivery, reference=requested.reference)
        if not names:
            return Progress(delivery)
        at = self.clock.now()
        data = event_data.changed_by_customer(names, delivery.reference)
        after = changed(delivery, updated_at=max(at, delivery.updated_at))
        return Progress(after, (Happening(DeliveryEventType.CHANGED, at, data),))

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
        fields = tuple(sorted(stored.data.by_field()))
        erased_at = now if fields else stored.erased_at
        return ErasedPersonalData(delivery_id=delivery_id, erased_at=erased_at, fields=fields)


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


def _changed(before: PersonalData, after: PersonalData) -> list[str]:
    """The names of what differs."""
    old, new = before.by_field(), after.by_field()
    return sorted(name for name in old.keys() | new.keys() if old.get(name) != new.get(name))
