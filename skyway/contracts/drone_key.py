"""Whose key a drone shows, and how many drones a provider has: the gateway asks the registry."""

from typing import Annotated, Final

from pydantic import Field

from skyway.ids import DroneId
from skyway.json_model import WireModel

#: How every key of a drone begins; all others are keys that the gateway made.
DRONE_KEY_PREFIX: Final = "dk_"


class DroneKeyQuery(WireModel):
    """The SHA-256 of a shown key, in hexadecimal."""

    key_hash: Annotated[
        str,
        Field(
            pattern=r"^[0-9a-f]{64}$",
            description="SHA-256 of the key that was shown, in hexadecimal.",
        ),
    ]


class DroneKeyAnswer(WireModel):
    """The drone that may show this key; None when it is nobody's, or not any more."""

    drone_id: DroneId | None


class DroneQuota(WireModel):
    """How many drones a provider may have, and has."""

    most: int
    used: int
