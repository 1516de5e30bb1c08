"""With which key a drone signs: the services ask the registry."""

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
    With `is_signed` and without a key, nothing is believed: it was revoked, or is not registered.
    """

    drone_id: DroneId
    is_signed: bool
    public_key: PublicKey | None = None


class DroneSignatureQuery(WireModel):
    """The drones that are asked about; none asks for those that changed in the last minute."""

    drone_ids: Annotated[tuple[DroneId, ...], Field(max_length=MOST_ASKED)] = ()


class DroneSignatures(WireModel):
    """The answer: each drone that was asked about, or each that changed in the last minute."""

    signatures: tuple[DroneSignature, ...]
