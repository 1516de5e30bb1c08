"""What a drone writes down before it acts or answers: the lines of its journal."""

from typing import Annotated, Any, Literal

from pydantic import Field

from skyway.contracts.drone_report import DroneEvent, RefusalCode
from skyway.contracts.instruction import Instruction
from skyway.contracts.message import FleetMoment
from skyway.ids import InstructionId
from skyway.json_model import WireModel


class Answer(WireModel):
    """The final answer to an instruction, kept so that a repeated one gets the same."""

    instruction_id: InstructionId
    stream: int
    seq: int
    status: Literal["ACCEPTED", "REJECTED"]
    code: RefusalCode | None = None
    detail: str | None = None
    data: dict[str, Any] = Field(default_factory=dict)  # numbers and names, as the code needs them
    traceparent: str | None = None


class InstructionAnswered(WireModel):
    """An instruction has come and is answered; `instruction` is None when it was not readable."""

    kind: Literal["INSTRUCTION"] = "INSTRUCTION"
    answered_at: FleetMoment
    answer: Answer
    instruction: Instruction | None


class AcceptanceTold(WireModel):
    """The broker has the ACCEPTED of the current mission's present revision."""

    kind: Literal["TOLD"] = "TOLD"
    told_at: FleetMoment


class StepBegun(WireModel):
    """A step begins; steps up to `released_through` cannot be replaced any more."""

    kind: Literal["STEP"] = "STEP"
    step_id: int
    started_at: FleetMoment
    released_through: int


class EventRecorded(WireModel):
    """Something has happened, and the cloud is to hear of it."""

    kind: Literal["EVENT"] = "EVENT"
    event: DroneEvent


Record = InstructionAnswered | AcceptanceTold | StepBegun | EventRecorded

#: A record as a line of the journal names its kind.
RecordLine = Annotated[Record, Field(discriminator="kind")]
