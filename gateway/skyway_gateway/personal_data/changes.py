"""How personal data changes: a member that is left out stays, and null removes it (RFC 7396)."""

from typing import Annotated

from pydantic import Field

from skyway.bounds import NotNull
from skyway.delivery.request import MAX_PACKAGES
from skyway.errors import InvalidInput
from skyway.ids import PackageId
from skyway.json_model import JsonModel
from skyway_gateway.personal_data.details import (
    MOST_METADATA,
    Contact,
    Email,
    HandOverDetails,
    Instructions,
    MetadataKey,
    MetadataValue,
    Name,
    PackageDetails,
    PersonalData,
    Phone,
)


class ContactChange(JsonModel):
    """Changes of a contact; a new contact needs a name."""

    name: Annotated[Name | None, NotNull, Field(description="The new name.")] = None
    phone: Annotated[
        Phone | None, Field(description="The new phone number in E.164 form; null removes it.")
    ] = None
    email: Annotated[
        Email | None, Field(description="The new e-mail address; null removes it.")
    ] = None


class HandOverChange(JsonModel):
    """Changes of the recipient and of the instructions."""

    recipient: Annotated[
        ContactChange | None, Field(description="Who takes it; null removes the recipient.")
    ] = None
    instructions: Annotated[
        Instructions | None,
        Field(description="What to know at the hand-over; null removes the instructions."),
    ] = None


class PackageChange(HandOverChange):
    """Changes of what one package has instead of the delivery's own details."""

    package_id: PackageId


class PersonalDataChange(HandOverChange):
    """Changes of the personal data of a delivery."""

    sender: Annotated[
        ContactChange | None, Field(description="Who brings the packages; null removes the sender.")
    ] = None
    metadata: Annotated[
        Annotated[
            dict[MetadataKey, Annotated[str, Field(max_length=500)]],
            Field(max_length=MOST_METADATA),
        ]
        | None,
        NotNull,
        Field(
            description="The members to change, up to 50; an empty text removes a member.",
        ),
    ] = None
    packages: Annotated[
        tuple[PackageChange, ...],
        Field(
            max_length=MAX_PACKAGES,
            description="The packages whose recipient or instructions are to be changed.",
        ),
    ] = ()

    def applied_to(self, before: PersonalData) -> PersonalData:
        """The personal data after the change.

        Raises
        ------
        InvalidInput
            A new contact has no name, or there would be too many members of `metadata`.
        """
        packages = {each.package_id: each for each in before.packages}
        for number, each in enumerate(self.packages):
            own = packages.get(each.package_id, PackageDetails(package_id=each.package_id))
            update = _hand_over_after(own, each, f"packages.{number}.")
            packages[each.package_id] = own.model_copy(update=update)
        update = _hand_over_after(before, self, "")
        if "sender" in self.model_fields_set:
            update["sender"] = _contact_after(before.sender, self.sender, "sender")
        update["metadata"] = _metadata_after(before, self.metadata or {})
        return PersonalData.of(
            before.model_copy(update=update), packages.values(), places=before.places
        )


def _hand_over_after(
    before: HandOverDetails, change: HandOverChange, prefix: str
) -> dict[str, object]:
    after: dict[str, object] = {}
    if "recipient" in change.model_fields_set:
        field = f"{prefix}recipient"
        after["recipient"] = _contact_after(before.recipient, change.recipient, field)
    if "instructions" in change.model_fields_set:
        after["instructions"] = change.instructions
    return after


def _contact_after(
    before: Contact | None, change: ContactChange | None, field: str
) -> Contact | None:
    if change is None:
        return None
    if before is not None:
        return before.merged(change)
    if change.name is None:
        raise InvalidInput(f"{field}.name", "is missing")
    return Contact(name=change.name, phone=change.phone, email=change.email)


def _metadata_after(
    before: PersonalData, change: dict[MetadataKey, str]
) -> dict[MetadataKey, MetadataValue]:
    after = {name: text for name, text in {**before.metadata, **change}.items() if text}
    if len(after) > MOST_METADATA:
        detail = f"must have at most {MOST_METADATA} members; it would have {len(after)}"
        raise InvalidInput("metadata", detail)
    return after
