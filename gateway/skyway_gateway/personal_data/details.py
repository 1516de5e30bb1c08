"""The details of people: how customers write them, how they are stored, and how they change.

None of them is a part of a `DeliveryRequest`: composition, drones and events never see them.
"""

import re
from collections.abc import Iterable, Mapping
from typing import Annotated, Final, Self

from pydantic import AfterValidator, Field

from skyway.errors import InvalidInput
from skyway.ids import PackageId
from skyway.json_model import JsonModel
from skyway_gateway.places.served import ServedPlace

#: Control characters, ends of lines, and what turns the direction of the text that follows.
_UNSAFE: Final = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069]")

#: The most members of `metadata`.
MOST_METADATA: Final = 50


def one_line(text: str) -> str:
    """The text, if it is one line that shows as it is written."""
    if _UNSAFE.search(text) or not text.strip():
        raise ValueError("must be one line of text, without control characters")
    return text


Name = Annotated[str, Field(min_length=1, max_length=100), AfterValidator(one_line)]
Phone = Annotated[str, Field(max_length=16, pattern=r"^[+][1-9][0-9]{6,14}$")]
Email = Annotated[str, Field(max_length=254, pattern=r"^[^@\s]+@[^@\s]+[.][^@\s]+$")]
Instructions = Annotated[str, Field(min_length=1, max_length=500)]
MetadataKey = Annotated[str, Field(min_length=1, max_length=40), AfterValidator(one_line)]
MetadataValue = Annotated[str, Field(min_length=1, max_length=500)]


class Contact(JsonModel):
    """A person or a firm, and how to reach them."""

    name: Annotated[Name, Field(description="The name, one line of 1 to 100 characters.")]
    phone: Annotated[
        Phone | None, Field(description="The phone number in E.164 form, such as +15125550100.")
    ] = None
    email: Annotated[
        Email | None, Field(description="The e-mail address, up to 254 characters.")
    ] = None

    @property
    def without_email(self) -> "Contact":
        """The contact as a provider sees it."""
        return self.model_copy(update={"email": None})


class HandOverDetails(JsonModel):
    """Who takes a package, and what the person who hands it over has to know."""

    recipient: Annotated[
        Contact | None, Field(description="Who takes it; not shown to drones or other tenants.")
    ] = None
    instructions: Annotated[
        Instructions | None,
        Field(description="What to know at the hand-over, 1 to 500 characters."),
    ] = None


class PackageDetails(HandOverDetails):
    """What one package has instead of the delivery's own recipient and instructions."""

    package_id: PackageId


class DeliveryDetails(HandOverDetails):
    """The details of a delivery; its recipient and instructions are those of all packages."""

    sender: Annotated[Contact | None, Field(description="Who brings the packages.")] = None
    metadata: Annotated[
        dict[MetadataKey, MetadataValue],
        Field(
            max_length=MOST_METADATA,
            description="The customer's own words: up to 50, with keys of 1 to 40 characters and "
            "texts of 1 to 500 characters. They are kept as personal data.",
        ),
    ] = Field(default_factory=dict)


class PersonalData(DeliveryDetails):
    """All personal data of one delivery, as it is stored."""

    packages: tuple[PackageDetails, ...] = ()
    places: tuple[ServedPlace, ...] = ()

    @classmethod
    def of(
        cls,
        given: DeliveryDetails,
        packages: Iterable[PackageDetails],
        *,
        places: tuple[ServedPlace, ...] = (),
    ) -> Self:
        """The personal data of a delivery, of those packages that have some, and its places."""
        own = {name: getattr(given, name) for name in DeliveryDetails.model_fields}
        of_packages = (
            PackageDetails(**{name: getattr(each, name) for name in PackageDetails.model_fields})
            for each in packages
            if each.recipient is not None or each.instructions is not None
        )
        return cls(**own, packages=tuple(of_packages), places=places)

    def of_package(self, package_id: PackageId) -> HandOverDetails:
        """The recipient and the instructions of a package, which may be those of the delivery."""
        own = next((each for each in self.packages if each.package_id == package_id), self)
        return HandOverDetails(
            recipient=own.recipient or self.recipient,
            instructions=own.instructions or self.instructions,
        )

    def by_field(self) -> Mapping[str, object]:
        """What is given, by names such as `recipient` and `packages.p1.instructions`."""
        given = {name: getattr(self, name) for name in DeliveryDetails.model_fields}
        given["places"] = self.places
        for each in self.packages:
            for name in HandOverDetails.model_fields:
                given[f"packages.{each.package_id}.{name}"] = getattr(each, name)
        return {name: value for name, value in given.items() if value}


#: Empty personal data.
NO_DATA: Final = PersonalData()


def require_packages(named: Iterable[PackageId], known: Iterable[PackageId]) -> None:
    """Check that `packages` of a body names packages of the delivery, each once.

    Raises
    ------
    InvalidInput
        There is no such package, or it stands twice.
    """
    left = set(known)
    for number, package_id in enumerate(named):
        if package_id not in left:
            field = f"packages.{number}.package_id"
            raise InvalidInput(
                field, f"{package_id!r} is not a package of this delivery, or is listed twice"
            )
        left.remove(package_id)
