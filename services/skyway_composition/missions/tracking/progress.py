"""A mission with its progress, as it is shown over REST."""

from collections.abc import Sequence
from typing import Annotated, Any, Literal

from pydantic import Field

from skyway.contracts.drone_report import Connection, DroneEvent, DroneState
from skyway.contracts.flight_step import FlightStep
from skyway.contracts.mission import Mission
from skyway.json_model import JsonModel
from skyway_composition.links.link import DroneLink
from skyway_composition.missions.mission.record import Aim, MissionRecord, Trouble
from skyway_composition.missions.mission.step_store import StepRecord, flown_totals


class StepProgress(JsonModel):
    """A step as it was sent to the drone, and the event that ended it."""

    step: Annotated[FlightStep, Field(description="The step as it was sent to the drone.")]
    revision: Annotated[int, Field(description="Revision of the mission that brought the step.")]
    status: Annotated[
        Literal["PLANNED", "ENDED", "FAILED"],
        Field(description="PLANNED until the drone reports its end, then ENDED or FAILED."),
    ]
    event: Annotated[
        DroneEvent | None, Field(description="The event that ended the step; null before that.")
    ]


class ProposedRevision(JsonModel):
    """A revision that the drone has not answered yet, and its reason."""

    revision: Annotated[int, Field(description="Number of the proposed revision.")]
    code: Annotated[str, Field(description="Why it is proposed.", examples=["LATE"])]
    detail: Annotated[str, Field(description="The reason as a sentence.")]


class MissionProgress(JsonModel):
    """A mission with its steps so far, and the drone's last state.

    While its drone stands idle without a mission, `drone_state` may be five minutes old.
    """

    mission: Annotated[Mission, Field(description="The mission.")]
    steps: Annotated[tuple[StepProgress, ...], Field(description="Its steps, in order.")]
    flown: Annotated[
        dict[str, float],
        Field(
            description=(
                "Totals of the ended steps: flight_s, recharging_s and waiting_s in seconds, "
                "energy_j in joules."
            ),
            examples=[
                {"flight_s": 870.0, "recharging_s": 0.0, "waiting_s": 12.0, "energy_j": 550_000.0}
            ],
        ),
    ]
    waits_for_revision: Annotated[
        dict[str, Any] | None,  # code, detail, station_id and soc
        Field(
            description=(
                "Why and where the drone waits for a new revision: code, detail, station_id and "
                "soc; null while it does not wait."
            )
        ),
    ]
    trouble: Annotated[
        Trouble | None, Field(description="Why another plan is needed; null if none is.")
    ]
    proposal: Annotated[
        ProposedRevision | None,
        Field(description="The revision that waits for the drone's answer; null if none does."),
    ]
    aims: Annotated[
        tuple[Aim, ...],
        Field(description="Packages that do not go to their destinations, and where they go."),
    ]
    drone_state: Annotated[
        DroneState | None, Field(description="The drone's last state; null before the first.")
    ]
    drone_connection: Annotated[
        Connection | None,
        Field(description="The drone's last connection message; null before the first."),
    ]


def progress_of(
    record: MissionRecord,
    steps: Sequence[StepRecord],
    *,
    events: Sequence[DroneEvent],
    link: DroneLink | None,
) -> MissionProgress:
    """A mission with its steps, the totals of its ended steps, and its drone's last messages."""
    return MissionProgress(
        mission=record.mission,
        steps=tuple(
            StepProgress(
                step=each.step, revision=each.revision, status=each.status, event=each.event
            )
            for each in steps
        ),
        flown=flown_totals(events),
        waits_for_revision=None if record.stuck is None else record.stuck.model_dump(),
        trouble=record.trouble,
        proposal=_proposed(record),
        aims=record.aims,
        drone_state=None if link is None else link.state,
        drone_connection=None if link is None else link.connection,
    )


def _proposed(record: MissionRecord) -> ProposedRevision | None:
    proposal = record.proposal
    if proposal is None:
        return None
    return ProposedRevision(
        revision=proposal.mission.revision, code=proposal.code, detail=proposal.detail
    )
