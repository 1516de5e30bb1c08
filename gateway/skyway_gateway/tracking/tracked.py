"""What a tracking page shows of a delivery: no people, prices, charges, or drones' ways home."""

from collections.abc import Iterator, Mapping
from datetime import datetime, timedelta
from typing import Annotated, Final, Literal

from pydantic import Field

from skyway.contracts.message import FleetMoment
from skyway.contracts.track import Track, TrackedMission, TrackedStep
from skyway.geo import Position
from skyway.ids import MissionId, PackageId, StationId
from skyway.json_model import JsonModel
from skyway_gateway.deliveries.lifecycle.delivery import (
    ON_BOARD_STATES,
    TERMINAL_STATES,
    Activity,
    Delivery,
    PackageState,
    PackageStatus,
)
from skyway_gateway.deliveries.lifecycle.delivery_parts import FlownMission
from skyway_gateway.deliveries.lifecycle.package_changes import with_p90
from skyway_gateway.proofs.verification import DropoffProof
from skyway_gateway.tracking.branding import Branding, ShownBranding

Stage = Literal[
    "REQUESTED", "PLANNED", "LOADING", "ON_THE_WAY", "DELIVERED", "PARTLY_DELIVERED", "ENDED"
]

_STAGES: Final[dict[str, Stage]] = {
    "SCHEDULED": "REQUESTED",
    "REQUESTED": "REQUESTED",
    "PLANNED": "PLANNED",
    "DISPATCHED": "PLANNED",
    "LOADING": "LOADING",
    "IN_PROGRESS": "ON_THE_WAY",
    "COMPLETED": "DELIVERED",
    "PARTIALLY_COMPLETED": "PARTLY_DELIVERED",
}


class TrackedPackage(JsonModel):
    """A package: where it goes, when it comes, and when it was handed over."""

    package_id: PackageId
    state: PackageState
    station_id: StationId
    eta_at: FleetMoment | None
    #: Nine of ten packages come by then. Until that is known: the latest time without a new plan.
    eta_until_at: FleetMoment | None
    #: Whether nine of ten come by `eta_until_at`.
    is_p90: bool
    promised_at: FleetMoment | None
    #: The promise from which lateness counts.
    due_at: FleetMoment | None
    delivered_at: FleetMoment | None
    #: Why it is not delivered, for programs: the words of it may name drones and people.
    code: str | None
    proof_station_id: StationId | None
    #: Where the drone stood, and what it measured, when it handed the package over.
    proof_position: Position | None
    proof_mass_kg: float | None
    #: Where it goes if nobody takes it at its destination.
    alternative_id: StationId
    #: Until when the drone waits for the proof; null while it does not.
    proof_until_at: FleetMoment | None
    #: The proof without which it is not handed over; null without one.
    dropoff_proof: DropoffProof | None


class TrackedFlight(JsonModel):
    """A flight that was flown, is flown now or will be flown."""

    status: Literal["FLOWN", "UNDER_WAY", "PLANNED"]
    from_position: Position
    to_position: Position


class TrackedPlace(JsonModel):
    """A station of the way; `role` says why it is on the map."""

    station_id: StationId
    position: Position
    role: Literal["PICKUP", "DESTINATION", "STOP"]


class TrackedDrone(JsonModel):
    """Where a drone that carries packages of this delivery was last seen."""

    position: Position
    at: FleetMoment | None


class TrackedDelivery(JsonModel):
    """The state of a tracking page."""

    stage: Stage
    state: str
    is_over: bool
    is_delayed: bool
    is_replanning: bool
    is_waiting: bool
    is_shared: Annotated[
        bool, Field(description="whether the drone carries packages of other deliveries too")
    ]
    #: What the drone does now; null before the start and after the end.
    activity: Activity | None
    requested_at: FleetMoment
    #: When the first packages are on board, as planned or as it was; null before there is a plan.
    loaded_at: FleetMoment | None
    #: While it waits: when the first drone is free, if that is known.
    drone_free_at: FleetMoment | None
    #: Where the sender hands the packages over, if it is not the pickup that was asked for.
    other_pickup_id: StationId | None
    now: FleetMoment
    rate: Annotated[float, Field(description="fleet seconds per second of wall time")]
    packages: tuple[TrackedPackage, ...]
    flights: tuple[TrackedFlight, ...]
    places: tuple[TrackedPlace, ...]
    station_names: dict[StationId, str]
    drones: tuple[TrackedDrone, ...]
    shop: Annotated[ShownBranding, Field(description="How the customer wants the page to look.")]


def tracked(
    delivery: Delivery,
    track: Track,
    *,
    shop: Branding,
    proofs: Mapping[str, DropoffProof],
    now: datetime,
    rate: float,
) -> TrackedDelivery:
    """The page's state."""
    delivery = with_p90(delivery)
    flown: dict[MissionId | None, FlownMission] = {
        mission.mission_id: mission for mission in delivery.missions
    }
    carrying = {
        package.mission_id for package in delivery.packages if package.state in ON_BOARD_STATES
    }
    return TrackedDelivery(
        stage=_STAGES.get(delivery.state, "ENDED"),
        state=delivery.state,
        is_over=delivery.state in TERMINAL_STATES,
        is_delayed=delivery.flags.delayed,
        is_replanning=delivery.flags.replanning,
        is_waiting=delivery.is_queued,
        activity=delivery.activity,
        requested_at=delivery.created_at,
        loaded_at=_loaded_at(track),
        drone_free_at=None if delivery.waiting is None else delivery.waiting.earliest_start_at,
        other_pickup_id=(
            None if delivery.pickup == delivery.request.pickup else delivery.pickup.station_id
        ),
        is_shared=any(mission.is_pooled for mission in delivery.missions),
        now=now,
        rate=rate,
        packages=tuple(
            _package(
                package,
                delivery,
                flown.get(package.mission_id) if package.mission_id else None,
                proofs.get(package.package_id),
                now=now,
            )
            for package in delivery.packages
        ),
        flights=tuple(
            TrackedFlight(
                status=_status_of(step),
                from_position=step.from_position,
                to_position=step.to_position,
            )
            for mission in track.missions
            for step in _steps_with_packages(mission)
            if step.kind == "FLY"
        ),
        places=tuple(_places(delivery, track)),
        station_names=track.station_names,
        drones=tuple(
            TrackedDrone(position=mission.position, at=mission.position_at)
            for mission in track.missions
            if mission.position is not None and mission.mission_id in carrying
        ),
        shop=ShownBranding.of(shop),
    )


def _package(
    package: PackageStatus,
    delivery: Delivery,
    mission: FlownMission | None,
    asked_proof: DropoffProof | None,
    *,
    now: datetime,
) -> TrackedPackage:
    asked = {each.package_id: each for each in delivery.request.packages}[package.package_id]
    proof = package.proof
    late = timedelta(seconds=0.0 if mission is None else mission.margins.tolerated_lateness_s)
    tolerated_at = None if package.eta_at is None else package.eta_at + late
    return TrackedPackage(
        package_id=package.package_id,
        state=package.state,
        station_id=package.destination.station_id,
        eta_at=package.eta_at,
        eta_until_at=package.eta_p90_at or tolerated_at,
        is_p90=package.eta_p90_at is not None,
        promised_at=package.promised_at,
        due_at=package.due_at,
        delivered_at=package.delivered_at,
        code=package.code,
        proof_station_id=None if proof is None else proof.station_id,
        proof_position=None if proof is None else proof.position,
        proof_mass_kg=None if proof is None else proof.mass_kg,
        alternative_id=(asked.alternative or delivery.pickup).station_id,
        proof_until_at=(
            package.proof_wait.until_at
            if package.proof_wait is not None and package.awaits_proof(now)
            else None
        ),
        dropoff_proof=asked_proof,
    )


def _steps_with_packages(mission: TrackedMission) -> tuple[TrackedStep, ...]:
    """The steps from the first loading on; where the drone comes from is not shown."""
    kinds = [step.kind for step in mission.steps]
    return mission.steps[kinds.index("PICK_UP") :] if "PICK_UP" in kinds else mission.steps


def _loaded_at(track: Track) -> datetime | None:
    """When the first loading ends."""
    loadings = (step for mission in track.missions for step in mission.steps)
    return min((step.end_at for step in loadings if step.kind == "PICK_UP"), default=None)


def _status_of(step: TrackedStep) -> Literal["FLOWN", "UNDER_WAY", "PLANNED"]:
    match step.status:
        case "ENDED":
            return "FLOWN"
        case "PLANNED":
            return "PLANNED"
        case _:
            return "UNDER_WAY"


def _places(delivery: Delivery, track: Track) -> Iterator[TrackedPlace]:
    """The stations of the way, each once."""
    pickup_id = delivery.pickup.station_id
    destinations = {package.destination.station_id for package in delivery.packages}
    positions = {
        step.station_id: step.to_position
        for mission in track.missions
        for step in _steps_with_packages(mission)
    }
    for station_id, position in positions.items():
        role: Literal["PICKUP", "DESTINATION", "STOP"] = "STOP"
        if station_id == pickup_id:
            role = "PICKUP"
        elif station_id in destinations:
            role = "DESTINATION"
        yield TrackedPlace(station_id=station_id, position=position, role=role)
