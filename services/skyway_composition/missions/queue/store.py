"""All SQL that keeps drones' calendars: which to look at, and how QUEUED missions move."""

from collections.abc import Collection
from typing import Final

from sqlalchemy import and_, bindparam, exists, func, literal_column, or_, select, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.candidate import Candidate
from skyway.ids import DroneId, MissionId
from skyway.runtime.sql.database import Tx
from skyway.runtime.sql.in_list import in_list
from skyway_composition.tables import is_live, is_queued, missions, networks

_next: Final = (
    select(missions.c.drone_id, func.min(missions.c.start_ms).label("start_ms"))
    .where(is_queued)
    .group_by(missions.c.drone_id)
    .subquery("next")
)
_before: Final = select(missions).where(is_live).subquery("before")
_queued: Final = missions.alias("queued")
_is_planned_in_another_world: Final = exists().where(
    _queued.c.drone_id == _next.c.drone_id,
    # A literal: with a parameter PostgreSQL does not take the index of queued missions, and reads
    # all missions that ever were.
    _queued.c.state == literal_column("'QUEUED'"),
    networks.c.network_id == _queued.c.network_id,
    or_(
        networks.c.version != _queued.c.planned_version,
        networks.c.conditions != _queued.c.planned_conditions,
    ),
)
#: The drones whose calendar may have to change.
TO_LOOK_AT: Final = (
    select(_next.c.drone_id)
    .select_from(_next.outerjoin(_before, _before.c.drone_id == _next.c.drone_id))
    .where(
        or_(
            and_(
                _before.c.mission_id.is_(None),
                _next.c.start_ms < bindparam("soon_ms"),
            ),
            and_(
                _before.c.released_ms > _next.c.start_ms - bindparam("hand_over_ms"),
                _before.c.proposal.is_(None),
            ),
            _is_planned_in_another_world,
            # Its drone may be silent for ever.
            _next.c.start_ms < bindparam("overdue_ms"),
        )
    )
    .order_by(_next.c.start_ms)
)


async def drones_to_look_at(
    connection: AsyncConnection, *, soon_ms: int, hand_over_ms: int, overdue_ms: int
) -> list[DroneId]:
    """The drones whose next mission may begin, does not fit, or has an outdated plan.

    A mission may begin when its drone is idle and its start lies before `soon_ms`. Drones whose
    next mission should have begun before `overdue_ms` are found too.
    """
    values = {"soon_ms": soon_ms, "hand_over_ms": hand_over_ms, "overdue_ms": overdue_ms}
    found = await connection.execute(TO_LOOK_AT, values)
    return list(found.scalars())


async def drones_with_queue(connection: AsyncConnection) -> list[DroneId]:
    """The drones that have a QUEUED mission."""
    found = await connection.execute(select(missions.c.drone_id).distinct().where(is_queued))
    return [DroneId(each) for each in found.scalars()]


async def save_start(tx: Tx, mission_id: MissionId, candidate: Candidate) -> None:
    """Save which drone flies a QUEUED mission that was planned again, and from where."""
    await tx.execute(
        update(missions)
        .where(missions.c.mission_id == mission_id)
        .values(drone_id=candidate.drone_id, candidate=candidate.model_dump_json())
    )


async def free_times(tx: Tx, mission_ids: Collection[MissionId]) -> None:
    """Make these QUEUED missions take no time of their drone until they are saved again.

    Without this, a mission that moves could overlap another one that has not moved yet.
    """
    await tx.execute(
        update(missions)
        .where(in_list(missions.c.mission_id, "mission_ids"), is_queued)
        .values(served_ms=missions.c.start_ms),
        {"mission_ids": [*mission_ids]},
    )
