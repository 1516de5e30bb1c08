"""Cloud to drone: missions and immediate instructions, in one gapless order per stream."""

from typing import Annotated, Literal

from pydantic import Field

from skyway.contracts.flight_step import FlightStep
from skyway.contracts.message import FleetMoment, Message
from skyway.ids import DeliveryId, InstructionId, MissionId


class _Instruction(Message):
    """What every instruction carries; composition mints `seq`, without gaps within a `stream`.

    `events_confirmed_seq`: the drone may forget its events up to this one.
    """

    instruction_id: InstructionId
    stream: Annotated[int, Field(ge=1)]
    seq: Annotated[int, Field(ge=1)]
    events_confirmed_seq: Annotated[int, Field(ge=0)] = 0
    expires_at: FleetMoment


class MissionInstruction(_Instruction):
    """Fly these steps; a later revision replaces what is not released, from `first_step` on."""

    kind: Literal["MISSION"] = "MISSION"
    mission_id: MissionId
    mission_revision: Annotated[int, Field(ge=1)]
    delivery_id: DeliveryId
    first_step: Annotated[int, Field(ge=1)]
    steps: Annotated[tuple[FlightStep, ...], Field(min_length=1)]


class CancelInstruction(_Instruction):
    """Forget a mission of which no step is released, or one that failed and waits.

    What is still on board after a failure is left at the station where the drone stands.
    """

    kind: Literal["CANCEL"] = "CANCEL"
    mission_id: MissionId
    mission_revision: Annotated[int, Field(ge=1)]
    reason: str


class ReportInstruction(_Instruction):
    """Send your events after this one again; it is about no mission."""

    kind: Literal["REPORT"] = "REPORT"
    mission_id: None = None
    mission_revision: None = None
    events_after_seq: Annotated[int, Field(ge=0)]


Instruction = Annotated[
    MissionInstruction | CancelInstruction | ReportInstruction, Field(discriminator="kind")
]
