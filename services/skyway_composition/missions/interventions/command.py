"""A command: what an operator tells the drone of a mission to do, and the answer."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from skyway.contracts.drone_health import ActiveFailsafe
from skyway.ids import InstructionId, MissionId, StationId
from skyway.json_model import JsonModel

CommandName = Literal["HOLD", "RESUME", "DIVERT", "RETURN_HOME", "CANCEL"]


class Command(JsonModel):
    """What a mission's drone is to do; `station_id` says where a DIVERT lands.

    A DIVERT or RETURN_HOME may override what the drone does by itself, and the faults behind it for
    the rest of the mission; landing at once because no landing can be reached is never overridden.
    """

    command: CommandName
    station_id: StationId | None = None
    reason: Annotated[str, Field(min_length=1, max_length=500)]
    overrides_failsafe: bool = False

    @model_validator(mode="after")
    def _says_where(self) -> Self:
        if (self.command == "DIVERT") != (self.station_id is not None):
            raise ValueError("DIVERT names a station_id, and no other command does")
        if self.overrides_failsafe and self.command not in ("DIVERT", "RETURN_HOME"):
            raise ValueError("only DIVERT and RETURN_HOME may have overrides_failsafe")
        return self


class CommandAnswer(JsonModel):
    """What was understood; without `instruction_id` the drone hears of it with its next plan.

    That waits until a failsafe that leads the drone elsewhere is over: `waits_for`.
    """

    mission_id: MissionId
    command: CommandName
    instruction_id: InstructionId | None = None
    waits_for: ActiveFailsafe | None = None
