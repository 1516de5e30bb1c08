"""All SQL of schedules: the missions of drones in a span, and when their steps began and ended."""

from collections.abc import Collection
from typing import Final

from sqlalchemy import ColumnElement, and_, bindparam, func, literal_column, or_, select, true
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.statistics import Span
from skyway.ids import DroneId, MissionId, ProviderId
from skyway.runtime.sql.in_list import in_list
from skyway_composition.missions.mission.record import MissionRecord, read_record
from skyway_composition.tables import is_open, mission_steps, missions

_OPEN_OF_DRONE: Final = (
    select(missions)
    .where(missions.c.drone_id == bindparam("of_drone"), is_open)
    .order_by(missions.c.start_ms, missions.c.mission_id)
)

_has_ended: Final = missions.c.state.in_(
    [literal_column("'COMPLETED'"), literal_column("'ABORTED'")]
)

_FLOWN: Final = (
    select(
        mission_steps.c.mission_id,
        func.min(func.coalesce(mission_steps.c.started_ms, mission_steps.c.planned_start_ms)),
        func.max(mission_steps.c.ended_ms),
    )
    .where(in_list(mission_steps.c.mission_id, "mission_ids"))
    .group_by(mission_steps.c.mission_id)
)


async def open_of_drone(connection: AsyncConnection, drone_id: DroneId) -> list[MissionRecord]:
    """The missions of a drone that are not over, in the order of their starts."""
    found = await connection.execute(_OPEN_OF_DRONE, {"of_drone": drone_id})
    return [read_record(row) for row in found]


async def drones_in_span(
    connection: AsyncConnection,
    provider_id: ProviderId,
    span: Span,
    *,
    now_ms: int,
    after: str | None,
    limit: int,
) -> list[DroneId]:
    """The provider's drones with missions in the span, by their ids, after the given one."""
    query = (
        select(missions.c.drone_id)
        .distinct()
        .where(missions.c.provider_id == provider_id, _is_in(span, now_ms))
        .order_by(missions.c.drone_id)
        .limit(limit)
    )
    if after is not None:
        query = query.where(missions.c.drone_id > after)
    return list((await connection.execute(query)).scalars())


async def missions_in_span(
    connection: AsyncConnection,
    provider_id: ProviderId,
    drone_ids: Collection[DroneId],
    span: Span,
    *,
    now_ms: int,
) -> dict[DroneId, list[MissionRecord]]:
    """The missions of each of these drones in the span, in the order of their starts."""
    query = (
        select(missions)
        .where(
            missions.c.provider_id == provider_id,
            in_list(missions.c.drone_id, "drone_ids"),
            _is_in(span, now_ms),
        )
        .order_by(missions.c.start_ms, missions.c.mission_id)
    )
    found: dict[DroneId, list[MissionRecord]] = {each: [] for each in drone_ids}
    for row in await connection.execute(query, {"drone_ids": [*drone_ids]}):
        found[row.drone_id].append(read_record(row))
    return found


async def missions_of_drone(
    connection: AsyncConnection, drone_id: DroneId, span: Span, *, now_ms: int
) -> list[MissionId]:
    """The missions of a drone in the span, in the order of their starts."""
    query = (
        select(missions.c.mission_id)
        .where(missions.c.drone_id == drone_id, _is_in(span, now_ms))
        .order_by(missions.c.start_ms, missions.c.mission_id)
    )
    return list((await connection.execute(query)).scalars())


def _is_in(span: Span, now_ms: int) -> ColumnElement[bool]:
    """Whether a mission was, or will be, in the span; a mission that is late lasts until now."""
    is_late_in_it = is_open if span.start_ms <= now_ms else ~true()
    return and_(
        missions.c.start_ms < span.end_ms,
        or_(
            is_late_in_it,
            and_(or_(is_open, _has_ended), missions.c.released_ms > span.start_ms),
        ),
    )


async def flown_times(
    connection: AsyncConnection, mission_ids: Collection[MissionId]
) -> dict[MissionId, tuple[int | None, int | None]]:
    """When each mission's first step begins, and when the last ended step ended."""
    found = await connection.execute(_FLOWN, {"mission_ids": [*mission_ids]})
    return {MissionId(mission_id): (start, end) for mission_id, start, end in found}
