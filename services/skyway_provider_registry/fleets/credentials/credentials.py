"""The credentials of a drone, and the token that it exchanges for them."""

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

    enrolment_token: Annotated[
        str,
        Field(
            min_length=1,
            max_length=_LONGEST_TOKEN,
            repr=False,
            description="the token that the drone's registration showed",
            examples=["enr_3q2-7w"],
        ),
    ]


class IssuedToken(JsonModel):
    """A new enrolment token."""

    drone_id: Annotated[DroneId, Field(description="the drone that may enrol with it")]
    enrolment_token: Annotated[
        str, Field(repr=False, description="the token; it is shown only once")
    ]
    expires_at: Annotated[
        AwareDatetime, Field(description="until when it can be exchanged, wall time")
    ]


class ClientCertificate(JsonModel):
    """A client certificate, for a broker that requires more than a password."""

    certificate_pem: Annotated[str, Field(description="the drone's certificate, PEM")]
    private_key_pem: Annotated[str, Field(repr=False, description="its private key, PEM")]
    ca_pem: Annotated[
        str, Field(description="certificate of the authority that the drone trusts, PEM")
    ]


class Credentials(JsonModel):
    """A broker account, and a key for the drone's own REST calls; both are shown only once."""

    mqtt: Annotated[MqttAccount, Field(description="account at the broker")]
    certificate: Annotated[
        ClientCertificate | None,
        Field(description="null where the deployment has no authority for drones"),
    ]
    key: Annotated[
        str, Field(repr=False, description="bearer token for the drone's own REST calls")
    ]


class Enrolment(Credentials):
    """Everything that a drone needs to start: its identity, its position and its credentials."""

    drone_id: Annotated[DroneId, Field(description="id of the drone")]
    provider_id: Annotated[ProviderId, Field(description="id of its provider")]
    model: Annotated[DroneModel, Field(description="its drone model with all limits")]
    home_station_id: Annotated[StationId, Field(description="id of its home station")]
    home_position: Annotated[
        Position, Field(description="longitude and latitude of the home station, degrees")
    ]
    station_id: Annotated[
        StationId | None, Field(description="the station where it last stood; null if unknown")
    ]
    position: Annotated[
        Position | None, Field(description="its last longitude and latitude; null if unknown")
    ]
    soc: Annotated[Soc, Field(description="its last state of charge, 0 to 1")]
