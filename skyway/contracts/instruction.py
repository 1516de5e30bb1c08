"""Cloud to drone: missions and immediate instructions, numbered without gaps in each stream."""

from enum import StrEnum
from typing import Annotated, Literal

from pydantic import Field

from skyway.contracts.flight_step import FlightStep, PackageOnBoard
from skyway.contracts.message import FleetMoment, Message
from skyway.ids import DeliveryId, InstructionId, MissionId, PackageId


class RefusalCode(StrEnum):
    """Why a drone refuses an instruction."""

    MALFORMED = "MALFORMED"
    UNSUPPORTED_STEP = "UNSUPPORTED_STEP"
    STALE_REVISION = "STALE_REVISION"
    STEP_RELEASED = "STEP_RELEASED"
    SEQUENCE_GAP = "SEQUENCE_GAP"
    EXPIRED = "EXPIRED"
    NOT_AT_START = "NOT_AT_START"
    OTHER_MISSION_ACTIVE = "OTHER_MISSION_ACTIVE"
    INSUFFICIENT_ENERGY = "INSUFFICIENT_ENERGY"
    OVERWEIGHT = "OVERWEIGHT"
    FAILSAFE_ACTIVE = "FAILSAFE_ACTIVE"
    NOT_AWAITED = "NOT_AWAITED"


class _Instruction(Message):
    """The fields of every instruction; composition counts `seq` without gaps within a `stream`.

    `events_confirmed_seq`: the drone may forget its events up to this one.
    """

    instruction_id: InstructionId
    stream: Annotated[int, Field(ge=1, description="The stream of instructions, from 1.")]
    seq: Annotated[
        int, Field(ge=1, description="The number of the instruction within its stream, from 1.")
    ]
    events_confirmed_seq: Annotated[
        int, Field(ge=0, description="The drone may forget its events up to this `seq`.")
    ] = 0
    expires_at: FleetMoment


class MissionInstruction(_Instruction):
    """Fly these steps; a later revision replaces unreleased steps, from `first_step` on.

    `loaded` ends a PICK_UP that awaits confirmation: what is on board, with its measured masses.
    """

    kind: Annotated[Literal["MISSION"], Field(description="Always MISSION.")] = "MISSION"
    mission_id: MissionId
    mission_revision: Annotated[int, Field(ge=1, description="The number of the plan, from 1.")]
    delivery_id: DeliveryId
    first_step: Annotated[int, Field(ge=1, description="The first step that this plan replaces.")]
    steps: Annotated[
        tuple[FlightStep, ...], Field(min_length=1, description="The steps to fly, in order.")
    ]
    loaded: Annotated[
        tuple[PackageOnBoard, ...] | None,
        Field(description="What is on board, measured; ends a PICK_UP that awaits it."),
    ] = None


class _Replacement(_Instruction):
    """New steps after `last_valid_step`. They may replace released steps, but not ended steps.

    `last_valid_step` is the step under way or a later one. It may be the step before the step under
    way if the step under way is a WAIT, RECHARGE or PICK_UP, which then ends immediately. A flight
    that is now followed by another flight does not land any more.

    While a failsafe acts, the drone refuses steps that do not override it: FAILSAFE_ACTIVE. If the
    failsafe lands immediately because no landing can be reached, nothing overrides it.
    """

    mission_id: MissionId
    mission_revision: Annotated[int, Field(ge=1, description="The number of the plan, from 1.")]
    delivery_id: DeliveryId
    last_valid_step: Annotated[int, Field(ge=0, description="The last step that stays as it was.")]
    steps: Annotated[
        tuple[FlightStep, ...],
        Field(min_length=1, description="The steps to fly after it, in order."),
    ]
    reason: Annotated[str, Field(description="Why, for people.")]
    overrides_failsafe: Annotated[
        bool, Field(description="Whether it holds although a failsafe acts.")
    ] = False

    @property
    def first_step(self) -> int:
        """The first step that is new."""
        return self.last_valid_step + 1


class DivertInstruction(_Replacement):
    """Something ahead of the drone is closed or lost: continue with these steps."""

    kind: Annotated[Literal["DIVERT"], Field(description="Always DIVERT.")] = "DIVERT"


class ReturnHomeInstruction(_Replacement):
    """An operator calls the drone home; the new steps say where the packages on board go."""

    kind: Annotated[Literal["RETURN_HOME"], Field(description="Always RETURN_HOME.")] = (
        "RETURN_HOME"
    )


class HoldInstruction(_Instruction):
    """Begin no further step once the drone stands at a station; it keeps its charging pad."""

    kind: Annotated[Literal["HOLD"], Field(description="Always HOLD.")] = "HOLD"
    mission_id: MissionId
    mission_revision: Annotated[int, Field(ge=1, description="The number of the plan, from 1.")]
    reason: Annotated[str, Field(description="Why, for people.")]


class ResumeInstruction(_Instruction):
    """End a hold; a later revision of the mission ends it too."""

    kind: Annotated[Literal["RESUME"], Field(description="Always RESUME.")] = "RESUME"
    mission_id: MissionId
    mission_revision: Annotated[int, Field(ge=1, description="The number of the plan, from 1.")]


class HandOverInstruction(_Instruction):
    """The proofs of these packages are there: hand them over in the DELIVER under way.

    A later revision of the plan does not matter. A drone that does not wait for the proofs, or
    waits no longer, refuses: NOT_AWAITED.
    """

    kind: Annotated[Literal["HAND_OVER"], Field(description="Always HAND_OVER.")] = "HAND_OVER"
    mission_id: MissionId
    mission_revision: Annotated[int, Field(ge=1, description="The number of the plan, from 1.")]
    step_id: Annotated[int, Field(ge=1, description="The number of the DELIVER, from 1.")]
    package_ids: Annotated[
        tuple[PackageId, ...],
        Field(min_length=1, description="The packages whose proofs are there."),
    ]


class CancelInstruction(_Instruction):
    """Forget a mission of which no step is released, or one that failed and waits.

    What is still on board after a failure is left at the station where the drone stands.
    """

    kind: Annotated[Literal["CANCEL"], Field(description="Always CANCEL.")] = "CANCEL"
    mission_id: MissionId
    mission_revision: Annotated[int, Field(ge=1, description="The number of the plan, from 1.")]
    reason: Annotated[str, Field(description="Why, for people.")]


class ReportInstruction(_Instruction):
    """Send your events after this one again; this instruction belongs to no mission."""

    kind: Annotated[Literal["REPORT"], Field(description="Always REPORT.")] = "REPORT"
    mission_id: Annotated[None, Field(description="Always null.")] = None
    mission_revision: Annotated[None, Field(description="Always null.")] = None
    events_after_seq: Annotated[
        int, Field(ge=0, description="The drone sends its events after this `seq` again.")
    ]


AnyInstruction = (
    MissionInstruction
    | DivertInstruction
    | ReturnHomeInstruction
    | HoldInstruction
    | ResumeInstruction
    | HandOverInstruction
    | CancelInstruction
    | ReportInstruction
)

Instruction = Annotated[AnyInstruction, Field(discriminator="kind")]
