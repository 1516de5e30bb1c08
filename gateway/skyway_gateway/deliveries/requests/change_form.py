"""What customers may change of a delivery, and the request that their change makes."""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Final

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from skyway.bounds import Moment
from skyway.delivery.request import MAX_PACKAGES, DeliveryRequest, Package
from skyway.delivery.verification import DropoffVerification
from skyway_gateway.personal_data.changes import PackageChange, PersonalDataChange
from skyway_gateway.proofs.verification import (
    CustomerVerification,
    DropoffProof,
    VerificationChange,
    read_verification,
)

#: The times of a request and of a package, which are changed while nothing is booked.
_TIMES: Final = ("earliest_pickup_at", "latest_pickup_at")
_TIMES_OF_PACKAGE: Final = ("not_before_at", "latest_at")

#: What else decides how a delivery is flown: other values are another request.
_FIXED: Final = frozenset(DeliveryRequest.model_fields.keys() - {*_TIMES, "packages", "reference"})
_FIXED_OF_PACKAGE: Final = frozenset(
    Package.model_fields.keys() - {*_TIMES_OF_PACKAGE, "package_id", "dropoff_verification"}
)


class ChangedPackage(PackageChange):
    """Changes of one package."""

    not_before_at: Annotated[
        Moment | None,
        Field(description="The hand-over does not begin before; null removes the limit."),
    ] = None
    latest_at: Annotated[
        Moment | None, Field(description="The hand-over is over by then; null removes the limit.")
    ] = None
    dropoff_verification: Annotated[
        VerificationChange | None,
        Field(
            description="The proof of the hand-over. Its `pin` is changed until the hand-over, "
            "everything else while the delivery is SCHEDULED; null removes the proof."
        ),
    ] = None

    @property
    def gives_pin(self) -> bool:
        """Whether it names a PIN."""
        proof = self.dropoff_verification
        return proof is not None and "pin" in proof.model_fields_set

    def proof_after(self, before: DropoffVerification | None) -> CustomerVerification | None:
        """What the customer asks for after a change of the proof; no PIN if it gives none.

        Raises
        ------
        InvalidInput
            A new proof has no method, or its members do not fit each other.
        """
        if self.dropoff_verification is None:
            return None
        known = {} if before is None else {"method": before.method, "wait_s": before.wait_s}
        given = self.dropoff_verification.model_dump(exclude_unset=True)
        return read_verification(known | given, field="packages.dropoff_verification")


class DeliveryChange(PersonalDataChange):
    """What is to be changed: a member that is left out stays, and null removes it.

    Times are changed while the delivery is SCHEDULED, everything else until the hand-over.
    """

    reference: Annotated[
        Annotated[str, Field(max_length=200)] | None,
        Field(description="The customer's own word for it, up to 200 characters; null removes it."),
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
        Field(description="Whether only to show the delivery as it would be after the change."),
    ] = False

    @model_validator(mode="before")
    @classmethod
    def _asks_for_the_same(cls, given: Any) -> Any:  # any JSON value
        if isinstance(given, Mapping) and (names := [*_fixed_names(given)]):
            raise PydanticCustomError(
                "fixed",
                "cannot change {names}: cancel the delivery, and request another one",
                {"names": ", ".join(names[:5])},
            )
        return given

    def new_pins(self, before: Mapping[str, DropoffProof]) -> list[str]:
        """The names of the PINs that change, such as `packages.p1.dropoff_verification.pin`."""
        return [
            f"packages.{each.package_id}.dropoff_verification.pin"
            for each in self.packages
            if each.gives_pin
            and each.dropoff_verification is not None
            and each.package_id in before
            and each.dropoff_verification.pin != before[each.package_id].pin
        ]

    def request_after(self, before: DeliveryRequest) -> DeliveryRequest:
        """The request with the changed times; the same object if none is changed."""
        changes = {each.package_id: each for each in self.packages}
        packages = tuple(
            _package_after(each, changes.get(each.package_id)) for each in before.packages
        )
        update = {**_given(self, _TIMES), "packages": packages}
        after = before.model_copy(update=update)
        return before if after == before else after


def _package_after(before: Package, change: ChangedPackage | None) -> Package:
    if change is None:
        return before
    update = _given(change, _TIMES_OF_PACKAGE)
    if "dropoff_verification" in change.model_fields_set:
        asked = change.proof_after(before.dropoff_verification)
        update["dropoff_verification"] = asked and asked.planned
    return before.model_copy(update=update)


def changed_times(before: DeliveryRequest, after: DeliveryRequest) -> Iterator[str]:
    """The names of the times that differ, such as `packages.p1.latest_at`."""
    yield from (name for name in _TIMES if getattr(before, name) != getattr(after, name))
    for old, new in zip(before.packages, after.packages, strict=True):
        for name in (*_TIMES_OF_PACKAGE, "dropoff_verification"):
            if getattr(old, name) != getattr(new, name):
                yield f"packages.{old.package_id}.{name}"


def _given(form: DeliveryChange | ChangedPackage, names: tuple[str, ...]) -> dict[str, object]:
    return {name: getattr(form, name) for name in names if name in form.model_fields_set}


def _fixed_names(given: Mapping[str, Any]) -> Iterator[str]:
    yield from sorted(_FIXED & given.keys())
    packages = given.get("packages")
    for number, each in enumerate(packages if isinstance(packages, list) else ()):
        if isinstance(each, Mapping):
            names = sorted(_FIXED_OF_PACKAGE & each.keys())
            yield from (f"packages.{number}.{name}" for name in names)
