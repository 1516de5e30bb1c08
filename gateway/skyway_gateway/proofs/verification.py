"""How customers ask for a proof of the hand-over, and what is known of a package's proof."""

import secrets
from collections.abc import Mapping
from typing import Annotated, Final, Literal, Self

from pydantic import Field, ValidationError, model_validator

from skyway.contracts.message import FleetMoment
from skyway.delivery.verification import (
    LONGEST_WAIT_S,
    SHORTEST_WAIT_S,
    DropoffVerification,
    PlannedVerification,
    ProofMethod,
)
from skyway.errors import InvalidInput
from skyway.json_model import JsonModel

#: Wrong PINs of one package. Then the recipient cannot prove the hand-over any more.
MOST_WRONG_PINS: Final = 5

_NEW_PIN_DIGITS: Final = 6

Pin = Annotated[str, Field(min_length=4, max_length=8, pattern=r"^[0-9]+$")]

GivenBy = Literal["RECIPIENT", "KEYPAD", "DRONE", "CUSTOMER", "OPERATOR"]


class CustomerVerification(DropoffVerification):
    """A package is handed over only with this proof; without the proof it goes back."""

    pin: Annotated[
        Pin | None,
        Field(
            repr=False,
            description="The PIN that the recipient types, 4 to 8 digits; only with the method "
            "PIN. Without it one of 6 digits is made.",
        ),
    ] = None

    @model_validator(mode="after")
    def _only_a_pin_has_digits(self) -> Self:
        if self.pin is not None and self.method != "PIN":
            raise ValueError(f"pin is for the method PIN; the method is {self.method}")
        return self

    @property
    def planned(self) -> PlannedVerification:
        """The part that is planned, without the PIN."""
        return PlannedVerification(method=self.method, wait_s=self.wait_s)


def read_verification(given: Mapping[str, object], *, field: str) -> CustomerVerification:
    """What these members ask for; `field` is where they stand in the caller's JSON.

    Raises
    ------
    InvalidInput
        A member is missing or breaks a limit.
    """
    try:
        return CustomerVerification.model_validate(given)
    except ValidationError as error:
        first = error.errors()[0]
        name = ".".join([field, *map(str, first["loc"])])
        raise InvalidInput(name, first["msg"].removeprefix("Value error, ")) from error


class VerificationChange(JsonModel):
    """Changes of a proof; a new proof needs a method."""

    method: Annotated[ProofMethod | None, Field(description="PIN, PHOTO or SIGNATURE.")] = None
    wait_s: Annotated[
        Annotated[int, Field(ge=SHORTEST_WAIT_S, le=LONGEST_WAIT_S)] | None,
        Field(description="How long the drone waits for the proof, seconds, 30 to 900."),
    ] = None
    pin: Annotated[
        Pin | None,
        Field(repr=False, description="Another PIN, 4 to 8 digits; null has one made."),
    ] = None


class DropoffProof(JsonModel):
    """What is known of the proof of a package's hand-over."""

    method: Annotated[ProofMethod, Field(description="How the hand-over is proven.")]
    pin: Annotated[
        str | None,
        Field(
            repr=False,
            description="The PIN that the recipient types; null once it is of no use, and for "
            "everybody who need not know it.",
        ),
    ] = None
    wrong_pins: Annotated[
        int,
        Field(description="How many wrong PINs were typed; after 5 only the customer gives proof."),
    ] = 0
    given_at: Annotated[
        FleetMoment | None, Field(description="When the proof was given; null before.")
    ] = None
    given_by: Annotated[
        GivenBy | None,
        Field(
            description="Who gave it: the RECIPIENT on the tracking page, a person at the drone's "
            "KEYPAD, the DRONE by its photo, or the CUSTOMER or an OPERATOR in its place."
        ),
    ] = None
    picture: Annotated[
        Literal["image/jpeg", "image/svg+xml"] | None,
        Field(description="The type of its picture; null without one, and once it is erased."),
    ] = None

    @property
    def is_locked(self) -> bool:
        """Whether too many wrong PINs were typed."""
        return self.wrong_pins >= MOST_WRONG_PINS

    @property
    def without_pin(self) -> "DropoffProof":
        """The proof without its PIN."""
        return self.model_copy(update={"pin": None})


def new_pin() -> str:
    """A PIN that nobody can foresee."""
    return f"{secrets.randbelow(10**_NEW_PIN_DIGITS):0{_NEW_PIN_DIGITS}}"
