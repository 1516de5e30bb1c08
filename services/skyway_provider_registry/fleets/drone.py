"""A drone as its provider registers it, changes it and sees it."""

from typing import Annotated, Literal, TypeVar

from pydantic import AwareDatetime, Field, field_validator

from skyway.contracts.drone_health import ActiveFailsafe, DroneHealth, Fault
from skyway.contracts.message import Soc
from skyway.drone.model import DroneModel
from skyway.geo import Position
from skyway.ids import DroneId, DroneModelId, MissionId, ProviderId, StationId
from skyway.json_model import JsonModel
from skyway_provider_registry.fleets.states import DroneStateName
from skyway_provider_registry.presence.drone_presence import Activity

T = TypeVar("T")

#: Most drones that one call registers.
MAX_NEW_DRONES = 5_000

DroneName = Annotated[str, Field(min_length=1, max_length=200)]
Registration = Annotated[
    str, Field(min_length=1, max_length=64, description="the aircraft's mark, one per provider")
]


class NewDrone(JsonModel):
    """A drone to register; `soc` is its charge until it tells of itself."""

    model_id: DroneModelId
    home_station_id: StationId
    name: DroneName | None = None
    registration: Registration | None = None
    soc: Soc = 1.0


class DroneChange(JsonModel):
    """The body of PATCH: what is left out stays as it is; null takes a name or a mark away."""

    name: DroneName | None = None
    registration: Registration | None = None
    home_station_id: StationId | None = None
    state: Literal["MAINTENANCE", "AVAILABLE"] | None = None

    @field_validator("home_station_id", "state")
    @classmethod
    def _stays(cls, value: T | None) -> T:
        if value is None:
            raise ValueError("may be left out, but not null")
        return value


class MqttAccount(JsonModel):
    """What a drone logs in to the broker with."""

    user_name: str
    password: Annotated[str, Field(repr=False)]


class Drone(JsonModel):
    """A registered drone and what is known of it; what it has not told of itself is null."""

    drone_id: DroneId
    provider_id: ProviderId
    model_id: DroneModelId
    model: DroneModel
    home_station_id: StationId
    home_position: Position
    name: str | None
    registration: str | None
    state: Annotated[DroneStateName, Field(title="Availability")]
    soc: Soc
    station_id: StationId | None
    position: Position | None
    activity: Activity | None
    mission_id: MissionId | None
    health: DroneHealth | None
    faults: tuple[Fault, ...]
    failsafe: ActiveFailsafe | None
    last_seen_at: Annotated[AwareDatetime | None, Field(description="RFC 3339 UTC, fleet time")]


class RegisteredDrone(Drone):
    """The answer to a registration: a token to enrol with, and an `mqtt` account; either works.

    Both are shown this once; the account's password stops when the token is exchanged.
    """

    enrolment_token: str
    mqtt: MqttAccount


class RegisteredDrones(JsonModel):
    """The answer to the registration of a list, in its order."""

    items: tuple[RegisteredDrone, ...]
