"""A drone as its provider registers it, changes it and sees it, and as the registry knows it."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import Field

from skyway.bounds import Moment, NotNull
from skyway.contracts.broker_rules import drone_account
from skyway.contracts.candidate import Standby
from skyway.contracts.drone_report import ActiveFailsafe, DroneHealth, Fault
from skyway.contracts.message import Soc
from skyway.contracts.mission_reports import FreeFrom
from skyway.contracts.signature import CloudKeys
from skyway.drone.model import DroneModel
from skyway.geo import Position
from skyway.ids import BatteryId, DroneId, DroneModelId, MissionId, NetworkId, ProviderId, StationId
from skyway.json_model import JsonModel
from skyway_provider_registry.enrolment.signing_store import SigningKey
from skyway_provider_registry.presence.drone_presence import Activity, Presence, condition_of
from skyway_provider_registry.presence.learning import LearnedDrone
from skyway_provider_registry.presence.wear import NEVER_FLOWN, DroneMaintenance

DroneStateName = Literal[
    "REGISTERED",
    "AVAILABLE",
    "RESERVED",
    "ON_MISSION",
    "RECHARGING",
    "OFFLINE",
    "MAINTENANCE",
    "GROUNDED",
]

DroneName = Annotated[
    str,
    Field(min_length=1, max_length=200, description="name for people", examples=["Heron 1"]),
]
ModelId = Annotated[DroneModelId, Field(description="id of the drone model")]
HomeStationId = Annotated[StationId, Field(description="id of the drone's home station")]
OwnStandby = Annotated[
    Standby | None,
    Field(description="HOME, STAY, PARKING or NEXT_PICKUP when idle; null means as its provider"),
]
Registration = Annotated[
    str,
    Field(
        min_length=1,
        max_length=64,
        description="the aircraft's registration mark, unique within its provider",
        examples=["N123SK"],
    ),
]


def state_of(presence: Presence, *, is_in_maintenance: bool, wall_now: datetime) -> DroneStateName:
    """The state of a drone with this presence."""
    return state_named(
        is_in_maintenance=is_in_maintenance,
        has_connected=presence.connection is not None,
        is_online=presence.is_online(wall_now),
        activity=None if presence.state is None else presence.state.activity,
        has_mission=presence.mission_id is not None,
        mission_state=presence.mission_state,
        names_mission=presence.names_mission,
    )


def state_named(
    *,
    is_in_maintenance: bool,
    has_connected: bool,
    is_online: bool,
    activity: str | None,
    has_mission: bool,
    mission_state: str | None,
    names_mission: bool,
) -> DroneStateName:
    """The state of a drone; a cause that keeps it from flying comes before its activity.

    A drone is ON_MISSION from the first step of its mission to the mission's end. Composition
    reports to the registry only that a mission was accepted and that it ended. So the drone's own
    `state` message shows the beginning: it names the mission (`names_mission`) and is not IDLE.
    """
    if is_in_maintenance:
        return "MAINTENANCE"
    if not has_connected:
        return "REGISTERED"
    if not is_online:
        return "OFFLINE"
    if activity is None:
        return "REGISTERED"
    if activity == "DOWN":
        return "GROUNDED"
    is_before_start = mission_state in ("BOOKED", "ACCEPTED")
    has_begun = not is_before_start or (names_mission and activity != "IDLE")
    if has_mission and has_begun:
        return "ON_MISSION"
    if activity == "RECHARGING":
        return "RECHARGING"
    return "RESERVED" if has_mission else "AVAILABLE"


class NewDrone(JsonModel):
    """A drone to register."""

    model_id: ModelId
    home_station_id: HomeStationId
    name: Annotated[DroneName | None, Field(description="name for people")] = None
    registration: Annotated[
        Registration | None,
        Field(description="the aircraft's registration mark, unique within its provider"),
    ] = None
    soc: Annotated[
        Soc, Field(description="state of charge until the drone's first state message, 0 to 1")
    ] = 1.0
    standby: OwnStandby = None
    public_key: SigningKey = None


class DroneChange(JsonModel):
    """Changes of a drone: fields that are left out stay.

    Null removes a name, a registration, and the drone's own standby.
    """

    name: Annotated[DroneName | None, Field(description="new name; null removes it")] = None
    registration: Annotated[
        Registration | None, Field(description="new registration mark; null removes it")
    ] = None
    home_station_id: Annotated[
        StationId | None, NotNull, Field(description="id of the new home station")
    ] = None
    state: Annotated[
        Literal["MAINTENANCE", "AVAILABLE"] | None,
        NotNull,
        Field(description="MAINTENANCE takes the drone out of service, AVAILABLE puts it back"),
    ] = None
    standby: OwnStandby = None


class MqttAccount(JsonModel):
    """A drone's account at the MQTT broker."""

    user_name: Annotated[str, Field(description="user name: provider_id/drone_id")]
    password: Annotated[str, Field(repr=False, description="password; it is shown only once")]


class Drone(JsonModel):
    """A registered drone and its present state; null where the drone has reported nothing yet."""

    drone_id: Annotated[DroneId, Field(description="id of the drone")]
    provider_id: Annotated[ProviderId, Field(description="id of its provider")]
    model_id: ModelId
    model: Annotated[DroneModel, Field(description="the drone model with all its limits")]
    home_station_id: HomeStationId
    home_position: Annotated[
        Position, Field(description="longitude and latitude of the home station, degrees")
    ]
    name: Annotated[str | None, Field(description="name for people")]
    registration: Annotated[str | None, Field(description="the aircraft's registration mark")]
    standby: Annotated[
        Standby | None, Field(description="what it does when idle; null means as its provider")
    ]
    state: Annotated[
        DroneStateName,
        Field(
            title="Availability",
            description="RESERVED: a mission is accepted; ON_MISSION: the mission has begun",
        ),
    ]
    soc: Annotated[Soc, Field(description="state of charge, 0 to 1")]
    station_id: Annotated[
        StationId | None, Field(description="the station where it stands; null in the air")
    ]
    position: Annotated[Position | None, Field(description="last longitude and latitude, degrees")]
    activity: Annotated[Activity | None, Field(description="what the drone does now")]
    mission_id: Annotated[MissionId | None, Field(description="the mission it is reserved for")]
    free_from: Annotated[
        FreeFrom | None,
        Field(
            description="when, where and with what charge it can begin another mission after all "
            "its missions; a moment that has passed means now; null without missions, or if unknown"
        ),
    ]
    health: Annotated[DroneHealth | None, Field(description="what the drone reports of itself")]
    learned: Annotated[LearnedDrone | None, Field(description="what its flights have shown")]
    battery_id: Annotated[BatteryId | None, Field(description="its registered battery, if any")]
    maintenance: Annotated[DroneMaintenance, Field(description="flown since the last maintenance")]
    faults: Annotated[tuple[Fault, ...], Field(description="faults that are present now")]
    failsafe: Annotated[
        ActiveFailsafe | None, Field(description="the failsafe that the drone carries out now")
    ]
    last_seen_at: Annotated[
        Moment | None, Field(description="moment of its last message, fleet time")
    ]


class RegisteredDrone(Drone):
    """A new drone with an enrolment token and a broker account; the drone needs one of them.

    Both are shown only once. The account's password stops working when the token is exchanged.
    """

    enrolment_token: Annotated[
        str, Field(description="token for POST /v1/enrolments; it is shown only once")
    ]
    mqtt: Annotated[MqttAccount, Field(description="account at the broker; it is shown only once")]
    cloud_keys: Annotated[
        CloudKeys, Field(description="keys by which the drone knows the cloud's messages")
    ]


@dataclass(frozen=True, slots=True)
class FleetDrone:
    """A registered drone; `initial_soc` is its charge until its first `state` message.

    Without a `standby` of its own it has its provider's. `network_id` is that of its home.
    """

    drone_id: DroneId
    provider_id: ProviderId
    model: DroneModel
    home_station_id: StationId
    home_position: Position
    name: str | None
    registration: str | None
    standby: Standby | None
    initial_soc: float
    is_in_maintenance: bool
    created_at: datetime
    presence: Presence
    network_id: NetworkId
    free_from: FreeFrom | None = None
    learned: LearnedDrone | None = None
    battery_id: BatteryId | None = None
    maintenance: DroneMaintenance = NEVER_FLOWN

    def state(self, wall_now: datetime) -> DroneStateName:
        """Its state at this moment of wall time."""
        return state_of(self.presence, is_in_maintenance=self.is_in_maintenance, wall_now=wall_now)

    def shown(self, wall_now: datetime) -> Drone:
        """The drone as its provider sees it."""
        return Drone.model_construct(**self._members(wall_now))

    def shown_once(
        self, wall_now: datetime, *, password: str, token: str, cloud_keys: CloudKeys
    ) -> RegisteredDrone:
        """The drone as its provider sees it once: with its token and its broker account."""
        user_name = drone_account(self.provider_id, self.drone_id)
        account = MqttAccount(user_name=user_name, password=password)
        return RegisteredDrone.model_construct(
            **self._members(wall_now), enrolment_token=token, mqtt=account, cloud_keys=cloud_keys
        )

    def _members(self, wall_now: datetime) -> dict[str, Any]:  # of every type
        """The members of a `Drone`, which are valid already; a fleet has thousands of drones."""
        reported = self.presence.state
        condition = condition_of(reported.condition if reported else None)
        position, soc = self.presence.place or (None, self.initial_soc)
        return {
            "drone_id": self.drone_id,
            "provider_id": self.provider_id,
            "model_id": self.model.model_id,
            "model": self.model,
            "home_station_id": self.home_station_id,
            "home_position": self.home_position,
            "name": self.name,
            "registration": self.registration,
            "standby": self.standby,
            "state": self.state(wall_now),
            "soc": soc,
            "station_id": reported.station_id if reported else None,
            "position": position,
            "activity": reported.activity if reported else None,
            "mission_id": self.presence.mission_id,
            "free_from": self.free_from,
            "health": condition.health,
            "learned": self.learned,
            "battery_id": self.battery_id,
            "maintenance": self.maintenance,
            "faults": condition.faults,
            "failsafe": condition.failsafe,
            "last_seen_at": self.presence.last_seen_at,
        }
