"""What the gateway reads from the registry and composition for its live picture of the fleet.

The gateway asks at each look, and shows what it has seen before, so it gets only changes.
Both services answer from their databases alone, so any replica may answer, and a restart of either
side changes nothing.
"""

from typing import Annotated, Final

from pydantic import Field

from skyway.contracts.drone_report import AlarmLevel, Fault
from skyway.contracts.flight_step import StepKind
from skyway.contracts.message import FleetMoment, Soc
from skyway.contracts.mission import MissionState, PackageEta
from skyway.geo import Position
from skyway.ids import (
    AlarmId,
    ClosureId,
    DeliveryId,
    DroneId,
    DroneModelId,
    MissionId,
    NetworkId,
    PackageId,
    ProviderId,
    StationId,
)
from skyway.json_model import WireModel

#: Where the gateway asks the registry and composition.
LIVE_DRONES: Final = "/internal/live/drones"
LIVE_WORLD: Final = "/internal/live/world"
LIVE_MISSIONS: Final = "/internal/live/missions"

#: The most missions of one question.
MOST_MISSIONS: Final = 500


class LiveDrone(WireModel):
    """A registered drone as it was last seen."""

    drone_id: DroneId
    provider_id: ProviderId
    model_id: DroneModelId
    name: str | None = None
    state: Annotated[str, Field(description="AVAILABLE, ON_MISSION, OFFLINE and others.")]
    activity: str | None = None
    at: Annotated[FleetMoment | None, Field(description="When it was there.")] = None
    position: Annotated[Position, Field(description="Before its first message: its home.")]
    soc: Soc
    station_id: StationId | None = None
    mission_id: MissionId | None = None
    faults: tuple[Fault, ...] = ()
    must_land_at: Annotated[
        FleetMoment | None,
        Field(description="When its charge will be down to the reserve, if it flies on."),
    ] = None
    safe_landings: Annotated[
        tuple[StationId, ...],
        Field(
            description="In flight: the nearest stations where it could land instead, by its own "
            "last report; 3 at most."
        ),
    ] = ()


class LiveDrones(WireModel):
    """The drones that have changed since a mark, or all drones.

    A drone may come again though it has not changed.
    """

    mark: Annotated[str, Field(description="To be shown with the next question.")]
    is_whole: Annotated[
        bool, Field(description="Whether these are all drones: others are registered no more.")
    ]
    drones: tuple[LiveDrone, ...]


class MissionVersion(WireModel):
    """A mission that is not over; its version changes whenever the mission does."""

    mission_id: MissionId
    version: str


class LivePad(WireModel):
    """A pad that is reserved now, out of order, or both."""

    taken_until_at: Annotated[
        FleetMoment | None,
        Field(description="End of the present reservation; null without one."),
    ] = None
    is_out_of_order: bool = False
    works_again_at: Annotated[
        FleetMoment | None,
        Field(description="End of the outage; null without one, or without a known end."),
    ] = None


class LiveStation(WireModel):
    """A station where pads are taken now or reserved for later; all others are free."""

    station_id: StationId
    network_id: NetworkId
    position: Position
    pads: int
    pads_taken: Annotated[
        int,
        Field(
            description="How many of them are reserved now or out of order, each counted once; "
            "the station is full when it is `pads`."
        ),
    ]
    taken: Annotated[dict[int, LivePad], Field(description="These pads by their numbers.")]
    queue: Annotated[int, Field(description="How many reservations begin later.")]
    next_free_at: FleetMoment | None = None


class LiveClosure(WireModel):
    """A closure, a zone or a ground stop that is not over."""

    closure_id: ClosureId
    kind: str
    from_at: FleetMoment
    until: FleetMoment | None = None
    network_id: NetworkId | None = None
    station_id: StationId | None = None
    pad: int | None = None
    to_station_id: StationId | None = None
    rings: tuple[tuple[Position, ...], ...] | None = None
    provider_id: ProviderId | None = None
    drone_model_id: DroneModelId | None = None
    reason: str | None = None


class LiveAlarm(WireModel):
    """An alarm that is not acknowledged."""

    alarm_id: AlarmId
    level: AlarmLevel
    code: str
    detail: str
    at: FleetMoment
    provider_id: ProviderId | None = None
    drone_id: DroneId | None = None
    mission_id: MissionId | None = None
    station_id: StationId | None = None


class LiveWorld(WireModel):
    """All that composition knows of the present; `alarms` are the newest."""

    missions: tuple[MissionVersion, ...]
    stations: tuple[LiveStation, ...]
    closures: tuple[LiveClosure, ...]
    alarms: tuple[LiveAlarm, ...]
    open_alarms: int


class LiveStep(WireModel):
    """A step of a mission: as planned, or as it was once it has ended."""

    step_id: int
    kind: StepKind
    status: str
    station_id: StationId
    position: Position
    from_position: Position | None = None
    pad: int | None = None
    lands: bool | None = None
    start_at: FleetMoment
    end_at: FleetMoment
    package_ids: tuple[PackageId, ...] = ()


class LiveMission(WireModel):
    """A mission with its plan and how far it has come."""

    mission_id: MissionId
    delivery_id: DeliveryId
    provider_id: ProviderId
    drone_id: DroneId
    flown_as: Annotated[
        MissionId | None,
        Field(description="The host's mission, which carries its packages; null if this one does."),
    ] = None
    state: MissionState
    revision: int
    packages: tuple[PackageEta, ...]
    trouble: str | None = None
    doubt: str | None = None
    is_held: bool = False
    is_carrying: Annotated[
        bool, Field(description="Whether the drone has packages of the delivery on board.")
    ]
    service_steps: Annotated[
        int, Field(description="How many steps belong to the delivery: not the way home.")
    ]
    steps: tuple[LiveStep, ...]


class LiveMissionsQuery(WireModel):
    """The missions whose versions are new to the gateway."""

    mission_ids: Annotated[tuple[MissionId, ...], Field(max_length=MOST_MISSIONS)]


class LiveMissions(WireModel):
    """Those of the missions that are still not over."""

    missions: tuple[LiveMission, ...]
