"""The gateway asks the registry whose key was shown, and how many drones a provider may have."""

from typing import Annotated, Final

from pydantic import Field

from skyway.ids import DroneId
from skyway.json_model import WireModel

#: How every key of a drone begins; the gateway made all other keys.
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
    """The drone that may show this key; None if no drone has this key now."""

    drone_id: DroneId | None


class DroneQuota(WireModel):
    """How many drones a provider may have, and how many it has."""

    most: int
    used: int
