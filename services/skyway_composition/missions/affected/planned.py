"""What live missions have still to do, as far as closures look at it."""

from collections.abc import Iterator
from dataclasses import dataclass

from skyway.contracts.flight_step import FlyStep
from skyway.ids import DeliveryId, DroneId, MissionId, ProviderId, StationId
from skyway.units import moment_to_ms
from skyway_composition.missions.record import Proposal


@dataclass(frozen=True, slots=True)
class Owner:
    """A live mission, whose it is and what for."""

    mission_id: MissionId
    drone_id: DroneId
    provider_id: ProviderId
    delivery_id: DeliveryId


@dataclass(frozen=True, slots=True)
class PlannedFlight:
    """A flight that a mission has still to end: from where to where, and when by plan."""

    owner: Owner
    step_id: int
    from_id: StationId
    to_id: StationId
    lands: bool
    start_ms: int
    end_ms: int


@dataclass(frozen=True, slots=True)
class HeldPad:
    """A pad that a mission holds."""

    owner: Owner
    station_id: StationId
    start_ms: int
    end_ms: int


@dataclass(frozen=True, slots=True)
class Doing:
    """What a drone last said that it does."""

    mission_id: MissionId | None
    step_id: int | None
    is_flying: bool


def flights_of(owner: Owner, proposal: Proposal) -> Iterator[PlannedFlight]:
    """The flights of a revision that the drone has not accepted yet."""
    for step in proposal.steps:
        if isinstance(step, FlyStep):
            yield PlannedFlight(
                owner,
                step.step_id,
                step.from_id,
                step.to_id,
                step.lands,
                moment_to_ms(step.planned_start_at),
                moment_to_ms(step.planned_end_at),
            )
