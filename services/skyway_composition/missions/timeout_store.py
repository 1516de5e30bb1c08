"""All SQL of timeouts; it runs every second, so its statements are built once."""

from collections import defaultdict
from dataclasses import dataclass
from typing import Final

from sqlalchemy import and_, bindparam, or_, select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import DroneId, MissionId, NetworkId
from skyway_composition.tables import is_live, is_under_way, missions

_OVERDUE: Final = (
    select(missions.c.drone_id)
    .where(
        or_(
            and_(missions.c.state == "BOOKED", missions.c.expires_ms < bindparam("expired_ms")),
            and_(is_live, missions.c.released_ms < bindparam("released_ms")),
        )
    )
    .order_by(missions.c.drone_id)
)

_LATE: Final = (
    select(missions.c.drone_id, missions.c.network_id)
    .where(
        is_under_way,
        missions.c.next_end_ms < bindparam("ended_ms"),
        missions.c.stuck.is_(None),
        missions.c.trouble.is_(None),
        missions.c.proposal.is_(None),
    )
    .order_by(missions.c.drone_id)
)

_AWAITED: Final = (
    select(missions.c.mission_id, missions.c.drone_id, missions.c.network_id, missions.c.start_ms)
    .where(is_live, missions.c.loading == "AWAITED", missions.c.start_ms < bindparam("before_ms"))
    .order_by(missions.c.start_ms)
)


@dataclass(frozen=True, slots=True)
class AwaitedLoading:
    """A mission that waits for its loader; loading does not begin before `start_ms`."""

    mission_id: MissionId
    drone_id: DroneId
    network_id: NetworkId
    start_ms: int


async def perhaps_overdue(
    connection: AsyncConnection, *, expired_ms: int, released_ms: int
) -> list[DroneId]:
    """Drones with an unanswered, expired booking, or with a plan that ended long ago."""
    values = {"expired_ms": expired_ms, "released_ms": released_ms}
    found = await connection.execute(_OVERDUE, values)
    return list(found.scalars())


async def perhaps_late(
    connection: AsyncConnection, *, ended_ms: int
) -> dict[NetworkId, list[DroneId]]:
    """Drones without trouble whose present step should have ended before this moment."""
    late: dict[NetworkId, list[DroneId]] = defaultdict(list)
    for row in await connection.execute(_LATE, {"ended_ms": ended_ms}):
        late[row.network_id].append(row.drone_id)
    return late


async def awaited_loadings(
    connection: AsyncConnection, *, started_before_ms: int
) -> list[AwaitedLoading]:
    """The live missions that should have started before this moment and wait for a loader."""
    found = await connection.execute(_AWAITED, {"before_ms": started_before_ms})
    return [
        AwaitedLoading(row.mission_id, row.drone_id, row.network_id, row.start_ms) for row in found
    ]
