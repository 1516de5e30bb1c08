"""A command: what an operator orders the drone of a mission to do, and the answer."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from skyway.contracts.drone_health import ActiveFailsafe
from skyway.ids import InstructionId, MissionId, StationId
from skyway.json_model import JsonModel

CommandName = Literal["HOLD", "RESUME", "DIVERT", "RETURN_HOME", "CANCEL", "GIVE_UP"]


class Command(JsonModel):
    """What the drone of a mission is to do; `station_id` says where a DIVERT lands.

    A DIVERT or RETURN_HOME may override an active failsafe, and its faults for the remainder of
    the mission. It never overrides an emergency landing that was ordered because no station can be
    reached.

    GIVE_UP ends a mission in doubt. Packages that were not loaded may then be flown by another
    drone, so an operator gives this command only after people have found out where they are.
    """

    command: Annotated[
        CommandName,
        Field(
            description="HOLD, RESUME, DIVERT to a station, RETURN_HOME, CANCEL, or GIVE_UP a "
            "mission in doubt: people know that its drone has not delivered, and will not.",
            examples=["HOLD"],
        ),
    ]
    station_id: Annotated[
        StationId | None, Field(description="Station where a DIVERT lands; only for DIVERT.")
    ] = None
    reason: Annotated[
        str,
        Field(
            min_length=1,
            max_length=500,
            description="Why the operator gives the command, for reports and the drone's log.",
            examples=["crowd at the station"],
        ),
    ]
    overrides_failsafe: Annotated[
        bool,
        Field(description="Whether a DIVERT or RETURN_HOME overrides an active failsafe."),
    ] = False

    @model_validator(mode="after")
    def _says_where(self) -> Self:
        if (self.command == "DIVERT") != (self.station_id is not None):
            raise ValueError("DIVERT names a station_id, and no other command does")
        if self.overrides_failsafe and self.command not in ("DIVERT", "RETURN_HOME"):
            raise ValueError("only DIVERT and RETURN_HOME may have overrides_failsafe")
        return self


class CommandAnswer(JsonModel):
    """The accepted command; without `instruction_id` the drone gets it with its next plan.

    That plan waits until the failsafe in `waits_for` is over.
    """

    mission_id: Annotated[MissionId, Field(description="Id of the mission.")]
    command: Annotated[CommandName, Field(description="The accepted command.")]
    instruction_id: Annotated[
        InstructionId | None,
        Field(description="Id of the instruction to the drone; null until a plan is made."),
    ] = None
    waits_for: Annotated[
        ActiveFailsafe | None,
        Field(description="Active failsafe that delays the command; null if nothing delays it."),
    ] = None
