"""All SQL of the live picture; it only reads, and locks nothing."""

from collections import defaultdict
from collections.abc import Collection
from typing import Final

from sqlalchemy import func, select, union_all
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.live import MissionVersion
from skyway.ids import MissionId
from skyway.runtime.sql.in_list import in_list
from skyway.runtime.sql.text_size import text_size
from skyway_composition.missions.mission.record import MissionRecord, read_record
from skyway_composition.missions.mission.step_store import StepRecord, step_record
from skyway_composition.tables import alarms, guests, is_open, mission_steps, missions

#: What every change of a mission changes; little of it is long, as it is read at each look of the
#: gateway. A hold is only in the mission's JSON: "true" and "false" differ in size.
_OPEN_MISSIONS: Final = (
    select(
        missions.c.mission_id,
        missions.c.state,
        missions.c.report_seq,
        missions.c.next_end_ms,
        missions.c.loading,
        missions.c.trouble,
        missions.c.stuck,
        text_size(missions.c.body),
    )
    .where(is_open)
    .order_by(missions.c.mission_id)
)
#: A guest is shown as a mission of its own, which changes with the mission of its host.
_OPEN_GUESTS: Final = (
    select(guests.c.mission_id, guests.c.host_id)
    .join(missions, missions.c.mission_id == guests.c.host_id)
    .where(is_open)
    .order_by(guests.c.mission_id)
)
_own: Final = missions.alias("own")
_FLOWN: Final = union_all(
    select(_own.c.mission_id).where(in_list(_own.c.mission_id, "mission_ids")),
    select(guests.c.host_id).where(in_list(guests.c.mission_id, "mission_ids")),
)
_MISSIONS: Final = select(missions).where(missions.c.mission_id.in_(_FLOWN), is_open)
_STEPS: Final = (
    select(mission_steps)
    .where(in_list(mission_steps.c.mission_id, "mission_ids"))
    .order_by(mission_steps.c.mission_id, mission_steps.c.step_id)
)
_OPEN_ALARMS: Final = select(func.count()).where(alarms.c.acknowledged_ms.is_(None))


async def open_missions(connection: AsyncConnection) -> tuple[MissionVersion, ...]:
    """The missions that are not over, and those of their guests, each with its version."""
    versions = {
        mission_id: ":".join(str(value) for value in values)
        for mission_id, *values in await connection.execute(_OPEN_MISSIONS)
    }
    of_guests = {
        row.mission_id: versions[row.host_id]
        for row in await connection.execute(_OPEN_GUESTS)
        if row.host_id in versions
    }
    return tuple(
        MissionVersion.model_construct(mission_id=mission_id, version=version)
        for mission_id, version in (versions | of_guests).items()
    )


async def missions_with_steps(
    connection: AsyncConnection, mission_ids: Collection[MissionId]
) -> list[tuple[MissionRecord, list[StepRecord]]]:
    """Those of these missions that are not over, with their steps in order.

    A guest is found with the mission that carries it.
    """
    rows = await connection.execute(_MISSIONS, {"mission_ids": [*mission_ids]})
    found = [read_record(row) for row in rows]
    steps: dict[str, list[StepRecord]] = defaultdict(list)
    flown = {"mission_ids": [each.mission_id for each in found]}
    for row in await connection.execute(_STEPS, flown):
        steps[row.mission_id].append(step_record(row))
    return [(record, steps[record.mission_id]) for record in found]


async def open_alarms(connection: AsyncConnection) -> int:
    """How many alarms are not acknowledged."""
    return int((await connection.execute(_OPEN_ALARMS)).scalar_one())
