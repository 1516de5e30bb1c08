"""The lines of a drone's journal, written before the drone acts or answers."""

from typing import Annotated, Any, Literal

from pydantic import Field

from skyway.contracts.drone_report import DroneEvent, Failsafe, Fault
from skyway.contracts.flight_step import FlyStep
from skyway.contracts.instruction import Instruction, RefusalCode
from skyway.contracts.message import FleetMoment, Soc
from skyway.geo import Position
from skyway.ids import InstructionId, StationId
from skyway.json_model import WireModel


class Answer(WireModel):
    """The final answer to an instruction; a repeated instruction gets the same answer."""

    instruction_id: InstructionId
    stream: int
    seq: int
    status: Literal["ACCEPTED", "REJECTED"]
    code: RefusalCode | None = None
    detail: str | None = None
    data: dict[str, Any] = Field(default_factory=dict)  # numbers and names, as the code needs them
    traceparent: str | None = None


class InstructionAnswered(WireModel):
    """An instruction was answered; `instruction` is None when it could not be read."""

    kind: Literal["INSTRUCTION"] = "INSTRUCTION"
    answered_at: FleetMoment
    answer: Answer
    instruction: Instruction | None


class AcceptanceSent(WireModel):
    """The broker has confirmed the ACCEPTED of the current mission's current revision."""

    kind: Literal["TOLD"] = "TOLD"
    acceptance_sent_at: FleetMoment


class StepBegun(WireModel):
    """A step begins; from now on steps up to `released_through` cannot be replaced."""

    kind: Literal["STEP"] = "STEP"
    step_id: int
    started_at: FleetMoment
    released_through: int


class EventRecorded(WireModel):
    """An event happened that is reported to the cloud."""

    kind: Literal["EVENT"] = "EVENT"
    event: DroneEvent


class FailsafeBegun(WireModel):
    """A failsafe turns the flight under way: from here the drone flies `flight` instead.

    `soc` is the charge here. `used_j` is the energy that the flight has used so far. The flight of
    LAND_NOW ends where it begins.
    """

    kind: Literal["FAILSAFE"] = "FAILSAFE"
    fault: Fault
    failsafe: Failsafe
    at: FleetMoment
    flight: FlyStep
    soc: Soc
    used_j: float


class FailsafeOverridden(WireModel):
    """People have overridden these faults: they are ignored for the rest of this mission.

    A turned flight continues from here to its planned end; `flight` is None when no flight was
    turned.
    """

    kind: Literal["OVERRIDDEN"] = "OVERRIDDEN"
    faults: tuple[Fault, ...]
    at: FleetMoment
    flight: FlyStep | None = None
    soc: Soc | None = None
    used_j: float = 0.0


class FaultEnded(WireModel):
    """A fault with an alarm has ended."""

    kind: Literal["FAULT_ENDED"] = "FAULT_ENDED"
    fault: Fault


class HealthLearned(WireModel):
    """A new estimate of the battery's capacity, as a share of its capacity when new."""

    kind: Literal["HEALTH"] = "HEALTH"
    state_of_health: Soc


class Placed(WireModel):
    """People fetched a drone that was down, emptied it, and put it at a station."""

    kind: Literal["PLACED"] = "PLACED"
    station_id: StationId
    position: Position


Record = (
    InstructionAnswered
    | AcceptanceSent
    | StepBegun
    | EventRecorded
    | FailsafeBegun
    | FailsafeOverridden
    | FaultEnded
    | HealthLearned
    | Placed
)

#: A record as a line of the journal, which names its kind.
RecordLine = Annotated[Record, Field(discriminator="kind")]
