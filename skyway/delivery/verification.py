"""How the hand-over of a package is proven: by the recipient's PIN, a photo, or a signature."""

from typing import Annotated, Final, Literal

from pydantic import Field

from skyway.json_model import JsonModel

ProofMethod = Literal["PIN", "PHOTO", "SIGNATURE"]

#: How long a drone may wait for a proof, seconds.
SHORTEST_WAIT_S: Final = 30
LONGEST_WAIT_S: Final = 900

#: The least wait of a network whose `recipient_wait_s` is shorter, seconds.
_LEAST_DEFAULT_WAIT_S: Final = 60.0


class DropoffVerification(JsonModel):
    """A package is handed over only with this proof; without the proof it goes back."""

    method: Annotated[
        ProofMethod,
        Field(
            description="PIN: the recipient types a PIN. PHOTO: the drone takes a picture. "
            "SIGNATURE: the recipient signs."
        ),
    ]
    wait_s: Annotated[
        int | None,
        Field(
            ge=SHORTEST_WAIT_S,
            le=LONGEST_WAIT_S,
            description="How long the drone waits for the proof, seconds, 30 to 900. If null, as "
            "long as the network's drones wait for a recipient, but at least 60.",
        ),
    ] = None

    def waits_s(self, recipient_wait_s: float) -> float:
        """How long the drone waits in a network with this `recipient_wait_s`, seconds."""
        if self.wait_s is not None:
            return self.wait_s
        return max(recipient_wait_s, _LEAST_DEFAULT_WAIT_S)


class PlannedVerification(DropoffVerification):
    """The same, with the address for the picture: only the drone that waits may use it."""

    upload_path: Annotated[
        str | None,
        Field(
            max_length=500,
            pattern=r"^/[!-~]*$",
            exclude_if=lambda value: value is None,
            description="Path at the gateway to which the drone uploads the picture of a PHOTO; "
            "holds a secret.",
            repr=False,
        ),
    ] = None
