"""Where a delivery's drones have been, are and will be: composition tells the gateway."""

from typing import Literal

from skyway.contracts.message import FleetMoment, Soc
from skyway.geo import Position
from skyway.ids import DroneId, MissionId, PackageId, ProviderId, StationId
from skyway.json_model import WireModel


class TrackedStep(WireModel):
    """A flight or a stop of a mission, as planned or as it was."""

    kind: Literal["PICK_UP", "FLY", "WAIT", "RECHARGE", "DELIVER", "RETURN"]
    status: Literal["ENDED", "UNDER_WAY", "PLANNED", "FAILED"]
    from_position: Position
    to_position: Position
    station_id: StationId
    start_at: FleetMoment
    end_at: FleetMoment
    package_ids: tuple[PackageId, ...] = ()


class TrackedMission(WireModel):
    """One drone's part: what it flew, where it is now, what it will fly up to its last delivery."""

    mission_id: MissionId
    provider_id: ProviderId
    drone_id: DroneId
    steps: tuple[TrackedStep, ...]
    position: Position | None
    position_at: FleetMoment | None
    soc: Soc | None


class Track(WireModel):
    """The answer to GET /internal/deliveries/{delivery_id}/track."""

    missions: tuple[TrackedMission, ...]
