"""The services ask the registry with which key a drone signs its messages."""

from typing import Annotated, Final

from pydantic import Field

from skyway.contracts.signature import PublicKey
from skyway.ids import DroneId
from skyway.json_model import WireModel

#: Where the registry answers.
DRONE_SIGNATURES: Final = "/internal/drone-signatures"

#: The most drones of one question.
MOST_ASKED: Final = 2_000


class DroneSignature(WireModel):
    """How a drone's messages are proven.

    Without `is_signed` the drone has registered no key, and its broker account alone proves them.
    With `is_signed` and without a key, no message of the drone is valid: its key was revoked, or
    the drone is not registered.
    """

    drone_id: DroneId
    is_signed: bool
    public_key: PublicKey | None = None


class DroneSignatureQuery(WireModel):
    """The drones in question; an empty list asks for those that changed in the last minute."""

    drone_ids: Annotated[tuple[DroneId, ...], Field(max_length=MOST_ASKED)] = ()


class DroneSignatures(WireModel):
    """The answer: each drone in question, or each drone that changed in the last minute."""

    signatures: tuple[DroneSignature, ...]
