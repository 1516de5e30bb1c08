"""Where a delivery's drones have been, are and will be: composition answers the gateway."""

from typing import Annotated, Literal

from pydantic import Field

from skyway.contracts.message import FleetMoment, Soc
from skyway.geo import Position
from skyway.ids import DroneId, MissionId, PackageId, ProviderId, StationId
from skyway.json_model import WireModel


class TrackedStep(WireModel):
    """A flight or a stop of a mission, as planned or as it was."""

    kind: Annotated[
        Literal["PICK_UP", "FLY", "WAIT", "RECHARGE", "DELIVER", "RETURN"],
        Field(description="What the step does."),
    ]
    status: Annotated[
        Literal["ENDED", "UNDER_WAY", "PLANNED", "FAILED"],
        Field(description="How far the step has come."),
    ]
    from_position: Annotated[Position, Field(description="Where it begins, in degrees.")]
    to_position: Annotated[Position, Field(description="Where it ends, in degrees.")]
    station_id: StationId
    start_at: FleetMoment
    end_at: FleetMoment
    package_ids: Annotated[
        tuple[PackageId, ...], Field(description="The packages that it handles.")
    ] = ()


class TrackedMission(WireModel):
    """What one drone flew, where it is now, and what it will fly up to its last delivery."""

    mission_id: MissionId
    provider_id: ProviderId
    drone_id: DroneId
    steps: Annotated[tuple[TrackedStep, ...], Field(description="Its flights and stops, in order.")]
    position: Annotated[
        Position | None,
        Field(description="Where the drone is, in degrees; null if it is not known."),
    ]
    position_at: FleetMoment | None
    soc: Soc | None


class Track(WireModel):
    """The answer to GET /internal/deliveries/{delivery_id}/track."""

    missions: Annotated[
        tuple[TrackedMission, ...], Field(description="The missions of the delivery.")
    ]
    station_names: Annotated[
        dict[StationId, str],
        Field(description="The names of its stations, for people; some may have none."),
    ] = Field(default_factory=dict)
