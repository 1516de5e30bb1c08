"""Previews what a command to a mission would do: nothing is changed, and nothing is sent."""

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from skyway.contracts.drone_report import ActiveFailsafe
from skyway.ids import MissionId
from skyway.json_model import JsonModel
from skyway_composition.context import Context
from skyway_composition.missions.interventions.give_command import (
    Command,
    CommandName,
    carry_out,
    obstacle,
)
from skyway_composition.missions.mission.unit_of_work import lock_mission
from skyway_composition.missions.replanning.foresee import Foresight, rehearsed
from skyway_composition.missions.replanning.outlook import MissionOutlook
from skyway_composition.missions.replanning.situation import Situation


class CommandPreview(JsonModel):
    """What a command would do to a mission, by a dry run."""

    mission_id: Annotated[MissionId, Field(description="Id of the mission.")]
    command: Annotated[CommandName, Field(description="The previewed command.")]
    waits_for: Annotated[
        ActiveFailsafe | None,
        Field(description="Active failsafe that would delay it; null if nothing delays it."),
    ]
    outlook: Annotated[
        MissionOutlook, Field(description="What the mission would do after the command.")
    ]


@dataclass(frozen=True, slots=True)
class CommandPreviews:
    """Previews commands."""

    context: Context
    foresight: Foresight

    async def preview(self, mission_id: MissionId, command: Command) -> CommandPreview:
        """Carry the command out in a transaction that is rolled back, and plan what follows.

        Raises
        ------
        NotFound, Conflict, InvalidInput
            The error with which the command would be refused.
        """
        async with self.context.db.rehearse() as tx:
            work, record = await lock_mission(self.context, tx, mission_id, provider_id=None)
            before = await Situation.of(work, record)
            await carry_out(work, record, command)
            seen = await rehearsed(work, before)
        return CommandPreview(
            mission_id=mission_id,
            command=command.command,
            waits_for=obstacle(command, record, before.link),
            outlook=await self.foresight.outlook(seen),
        )
