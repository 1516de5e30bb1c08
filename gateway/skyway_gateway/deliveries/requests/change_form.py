"""What customers may change of a delivery, and the request that their change makes."""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Final

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from skyway.bounds import Moment, NotNull
from skyway.delivery.qos import QoS
from skyway.delivery.request import (
    MAX_PACKAGE_MASS_KG,
    MAX_PACKAGES,
    DeliveryRequest,
    Package,
)
from skyway.drone.cargo import DangerousClass, Handling, SizeMm
from skyway.errors import InvalidInput
from skyway_gateway.personal_data.changes import PackageChange, PersonalDataChange
from skyway_gateway.places.customer_request import CustomerPlace, CustomerRequest


class ChangedPackage(PackageChange):
    """Changes of one package."""

    mass_kg: Annotated[
        Annotated[float, Field(ge=0, le=MAX_PACKAGE_MASS_KG)] | None,
        NotNull,
        Field(description="Mass in kilograms, 0 to 1000."),
    ] = None
    size_mm: Annotated[
        SizeMm | None,
        Field(description="Outer size in whole millimetres; null: any cargo box is large enough."),
    ] = None
    handling: Annotated[
        Annotated[tuple[Handling, ...], Field(max_length=4)] | None,
        NotNull,
        Field(description="What its drone must be able to do."),
    ] = None
    dangerous_class: Annotated[
        DangerousClass | None,
        Field(description="The UN class of dangerous goods; with DANGEROUS only."),
    ] = None
    destination: Annotated[
        CustomerPlace | None, NotNull, Field(description="Where it is handed over.")
    ] = None
    alternative: Annotated[
        CustomerPlace | None,
        Field(description="Where it goes if nobody is at the destination; null: to the pickup."),
    ] = None
    not_before_at: Annotated[
        Moment | None,
        Field(description="The hand-over does not begin before; null removes the limit."),
    ] = None
    latest_at: Annotated[
        Moment | None, Field(description="The hand-over is over by then; null removes the limit.")
    ] = None


class DeliveryChange(PersonalDataChange):
    """What is to be changed: a member that is left out stays, and null removes it.

    What decides how it is flown (times, `qos`, and destinations, masses, sizes and windows of
    packages) is changed until a drone is sent. Everything else is changed until the hand-over.
    """

    reference: Annotated[
        Annotated[str, Field(max_length=200)] | None,
        Field(description="The customer's own word for it, up to 200 characters; null removes it."),
    ] = None
    qos: Annotated[
        QoS | None,
        NotNull,
        Field(description="The members of `qos` to change; those that are left out stay."),
    ] = None
    earliest_pickup_at: Annotated[
        Moment | None,
        Field(description="The drone does not begin to load before; null removes the limit."),
    ] = None
    latest_pickup_at: Annotated[
        Moment | None, Field(description="Loading is over by then; null removes the limit.")
    ] = None
    packages: Annotated[
        tuple[ChangedPackage, ...],
        Field(max_length=MAX_PACKAGES, description="The packages to change."),
    ] = ()
    dry_run: Annotated[
        bool,
        Field(
            description="Whether only to show the delivery as it would be after the change, with "
            "the price if it is to be flown in another way."
        ),
    ] = False

    @model_validator(mode="before")
    @classmethod
    def _leaves_the_pickup(cls, given: Any) -> Any:  # any JSON value
        if isinstance(given, Mapping) and "pickup" in given:
            raise PydanticCustomError(
                "fixed", "cannot change pickup: cancel the delivery, and request another one"
            )
        return given

    def asked_after(self, before: DeliveryRequest) -> CustomerRequest | None:
        """The request after the change, in the customer's form; None if it stays.

        Raises
        ------
        InvalidInput
            Members that are changed do not fit those that stay.
        """
        given = _given(self, _OF_REQUEST)
        by_id = {each.package_id: _given(each, _OF_PACKAGE) for each in self.packages}
        if not (given or any(by_id.values())):
            return None
        if self.qos is not None:
            given["qos"] = before.qos.merged(self.qos)
        packages = [_asked(each) | by_id.get(each.package_id, {}) for each in before.packages]
        pickup = CustomerPlace(station_id=before.pickup.station_id)
        return CustomerRequest.checked(
            {**dict(before), **given, "pickup": pickup, "packages": packages}
        )

    def in_own_words(self, fault: InvalidInput, before: DeliveryRequest) -> InvalidInput:
        """The fault of the changed request, with the field as this change counts packages."""
        start, _, rest = fault.field.partition(".")
        number, _, name = rest.partition(".")
        if start != "packages" or not number.isdigit():
            return fault
        package_id = before.packages[int(number)].package_id
        own = [index for index, each in enumerate(self.packages) if each.package_id == package_id]
        field = f"packages.{own[0]}.{name}" if own else f"packages of {package_id}: {name}"
        return InvalidInput(field.rstrip("."), fault.detail)


#: The members of a change that decide how a delivery is flown, and the same of its packages.
_OF_REQUEST: Final = ("qos", "earliest_pickup_at", "latest_pickup_at")
_OF_PACKAGE: Final = tuple(ChangedPackage.model_fields.keys() - PackageChange.model_fields.keys())


def changed_members(before: DeliveryRequest, after: DeliveryRequest) -> Iterator[str]:
    """The names of the members that differ, such as `qos` and `packages.p1.latest_at`."""
    yield from (name for name in _OF_REQUEST if getattr(before, name) != getattr(after, name))
    for old, new in zip(before.packages, after.packages, strict=True):
        for name in sorted(_OF_PACKAGE):
            if getattr(old, name) != getattr(new, name):
                yield f"packages.{old.package_id}.{name}"


def _given(form: DeliveryChange | ChangedPackage, names: tuple[str, ...]) -> dict[str, object]:
    return {name: getattr(form, name) for name in names if name in form.model_fields_set}


def _asked(package: Package) -> dict[str, object]:
    """A package with its stations as places."""
    other: CustomerPlace | None = None
    if package.alternative is not None:
        other = CustomerPlace(station_id=package.alternative.station_id)
    destination = CustomerPlace(station_id=package.destination.station_id)
    return {**dict(package), "destination": destination, "alternative": other}
