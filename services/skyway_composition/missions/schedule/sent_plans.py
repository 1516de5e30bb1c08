"""The plans that were sent to a drone, for replays of a past time."""

from typing import Annotated

from pydantic import Field

from skyway.contracts.flight_step import FlightStep
from skyway.contracts.message import FleetMoment
from skyway.ids import DroneId, MissionId
from skyway.json_model import JsonModel
from skyway_composition.links.instruction_store import SentPlan


class DronePlan(JsonModel):
    """A plan as it was sent to a drone.

    Its steps replace the steps from `first_step` on of the mission's plan before it.
    """

    mission_id: Annotated[MissionId, Field(description="Mission of the plan.")]
    mission_revision: Annotated[
        int, Field(description="Number of the plan within its mission, from 1.")
    ]
    sent_at: Annotated[FleetMoment, Field(description="When it was sent, fleet time.")]
    is_accepted: Annotated[bool, Field(description="Whether the drone has accepted it.")]
    first_step: Annotated[int, Field(description="The first step that it replaces.")]
    steps: Annotated[
        tuple[FlightStep, ...], Field(description="Its steps, in order, with planned times.")
    ]


class DronePlans(JsonModel):
    """The plans of the missions that a drone had in a span."""

    drone_id: Annotated[DroneId, Field(description="Id of the drone.")]
    from_at: Annotated[FleetMoment, Field(description="Start of the span, fleet time.")]
    to_at: Annotated[FleetMoment, Field(description="End of the span, fleet time.")]
    plans: Annotated[
        tuple[DronePlan, ...],
        Field(description="In the order in which they were sent; some were sent before the span."),
    ]


def drone_plan(sent: SentPlan) -> DronePlan:
    """A sent plan as a replay shows it."""
    instruction = sent.instruction
    return DronePlan(
        mission_id=instruction.mission_id,
        mission_revision=instruction.mission_revision,
        sent_at=instruction.sent_at,
        is_accepted=sent.is_accepted,
        first_step=instruction.first_step,
        steps=instruction.steps,
    )
