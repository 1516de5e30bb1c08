"""What a drone is given to log in and to call with, and what gives it that."""

from typing import Annotated, Final

from pydantic import AwareDatetime, Field

from skyway.contracts.message import Soc
from skyway.drone.model import DroneModel
from skyway.geo import Position
from skyway.ids import DroneId, ProviderId, StationId
from skyway.json_model import JsonModel
from skyway_provider_registry.fleets.drone import MqttAccount

#: Characters.
_LONGEST_TOKEN: Final = 200


class EnrolmentRequest(JsonModel):
    """The body of POST /v1/enrolments."""

    enrolment_token: Annotated[str, Field(min_length=1, max_length=_LONGEST_TOKEN, repr=False)]


class IssuedToken(JsonModel):
    """A new enrolment token, shown this once."""

    drone_id: DroneId
    enrolment_token: Annotated[str, Field(repr=False)]
    expires_at: Annotated[AwareDatetime, Field(description="RFC 3339 UTC, wall time")]


class ClientCertificate(JsonModel):
    """What a drone shows to a broker that wants more than a password, and whom it trusts."""

    certificate_pem: str
    private_key_pem: Annotated[str, Field(repr=False)]
    ca_pem: str


class Credentials(JsonModel):
    """A broker account, and a bearer for the drone's own REST calls; shown this once.

    There is a certificate where the deployment has an authority that signs them.
    """

    mqtt: MqttAccount
    certificate: ClientCertificate | None
    key: Annotated[str, Field(repr=False)]


class Enrolment(Credentials):
    """What a drone needs to start: who it is, where it stands if it never flew, its credentials."""

    drone_id: DroneId
    provider_id: ProviderId
    model: DroneModel
    home_station_id: StationId
    home_position: Position
    station_id: StationId | None
    position: Position | None
    soc: Soc
