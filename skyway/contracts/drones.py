"""Questions about drones between the services, and what the registry reports about drones.

The gateway asks the registry whose key was shown, and how many drones a provider may have. All
services ask with which key a drone signs. Composition asks which drones may not begin a mission,
which providers exchange deliveries, and how many drones a network has. The registry asks
composition to raise alarms, and reports renewed credentials.
"""

from typing import Annotated, Final

from pydantic import Field

from skyway.bounds import SmallObject, Words
from skyway.contracts.drone_report import AlarmLevel
from skyway.contracts.message import FleetMoment
from skyway.contracts.signature import PublicKey
from skyway.delivery.offer import Tariff
from skyway.drone.model import DroneModel
from skyway.ids import DroneId, DroneModelId, NetworkId, ProviderId
from skyway.json_model import WireModel

#: How every key of a drone begins; the gateway made all other keys.
DRONE_KEY_PREFIX: Final = "dk_"


class DroneKeyQuery(WireModel):
    """The SHA-256 of a shown key, in hexadecimal."""

    key_hash: Annotated[
        str,
        Field(
            pattern=r"^[0-9a-f]{64}$",
            max_length=64,
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


#: Where the registry answers.
DRONE_SIGNATURES: Final = "/internal/drone-signatures"

#: The most drones that one call registers.
MOST_NEW_DRONES: Final = 500

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
    network_id: Annotated[
        NetworkId | None, Field(description="Network of its home; null if it is not known.")
    ] = None


class DroneSignatureQuery(WireModel):
    """The drones in question; an empty list asks for those that changed in the last minute."""

    drone_ids: Annotated[tuple[DroneId, ...], Field(max_length=MOST_ASKED)] = ()


class DroneSignatures(WireModel):
    """The answer: each drone in question, or each drone that changed in the last minute."""

    signatures: tuple[DroneSignature, ...]


#: Where the registry posts an alarm.
DRONE_ALARMS: Final = "/internal/drone-alarms"


class DroneAlarm(WireModel):
    """A problem of a drone that operators and its provider must look at."""

    provider_id: ProviderId
    drone_id: DroneId
    level: AlarmLevel
    code: Annotated[str, Field(max_length=100)]
    detail: Words
    at: FleetMoment
    data: SmallObject = Field(default_factory=dict)
    is_over: Annotated[
        bool, Field(description="Whether this ends the open alarms with the code.")
    ] = False


#: Where composition asks.
OUT_OF_SERVICE: Final = "/internal/drones-out-of-service"

#: The most drones of one question.
MOST_DRONES: Final = 1_000


class OutOfServiceQuery(WireModel):
    """The drones that composition plans to send somewhere later."""

    drone_ids: Annotated[tuple[DroneId, ...], Field(max_length=MOST_DRONES)]


class OutOfServiceAnswer(WireModel):
    """Drones in MAINTENANCE, of a SUSPENDED provider, or not registered any more.

    The drones in `due_drone_ids` are due for maintenance: they fly the missions that they have, and
    get no others.
    """

    drone_ids: tuple[DroneId, ...]
    due_drone_ids: tuple[DroneId, ...] = ()


#: Where composition asks which providers exchange deliveries.
EXCHANGING: Final = "/internal/exchanging-providers"


class ExchangingProviders(WireModel):
    """The present tariffs of the providers that exchange deliveries and are ACTIVE."""

    tariffs: dict[ProviderId, Tariff]


#: Where composition asks how many drones a network has.
NETWORK_DRONES: Final = "/internal/networks/{network_id}/drones"


class DronesOfModel(WireModel):
    """How many drones of one model a network has.

    `online` drones are in service and have reported of late. `idle` drones are online, charged
    above their reserve, and have no mission.
    """

    model_id: DroneModelId
    max_payload_kg: float
    model: DroneModel
    registered: int
    online: int
    idle: int


class NetworkDrones(WireModel):
    """The drones of a network by their model, in the order of the models' ids.

    A drone belongs to the network of its station, and in the air to that of its home. `unplaced`
    counts the drones of which the registry knows neither; networks that are too large to be
    cached have only such drones.
    """

    models: tuple[DronesOfModel, ...]
    unplaced: int


#: Where the registry posts renewals.
RENEWALS: Final = "/internal/renewed-credentials"


class Renewal(WireModel):
    """The credentials of a drone have changed, or were revoked.

    Another sender may have used the earlier credentials. The numbers of its messages (session, seq,
    stream) say nothing about the messages that come with the new credentials.
    """

    drone_id: DroneId
    at: FleetMoment


class Renewals(WireModel):
    """The renewals of some drones."""

    renewals: Annotated[tuple[Renewal, ...], Field(max_length=500)]
