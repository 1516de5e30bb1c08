"""All SQL of timeouts; it runs every second, so its statements are built once."""

import json
from collections import defaultdict
from dataclasses import dataclass
from typing import Final

from sqlalchemy import and_, bindparam, or_, select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import DroneId, MissionId, NetworkId
from skyway_composition.tables import is_live, is_under_way, missions, outbox

#: How long the first report of a mission may wait for the gateway, ms of wall time. The alarm
#: comes within 30 s, and the loop that raises it may be slow itself.
UNKNOWN_AFTER_MS: Final = 15_000
#: The code of that alarm.
UNKNOWN_CODE: Final = "MISSIONS_UNKNOWN"
#: How many waiting reports are looked at to find such missions.
_MOST_REPORTS: Final = 1_000

_OLD_REPORTS: Final = (
    select(outbox.c.stream, outbox.c.payload, outbox.c.stored_wall_ms)
    .where(outbox.c.channel == "gateway", outbox.c.stored_wall_ms < bindparam("before_ms"))
    .order_by(outbox.c.id)
    .limit(_MOST_REPORTS)
)

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


async def unknown_missions(connection: AsyncConnection, *, wall_ms: int) -> dict[str, int]:
    """The missions that the gateway does not know: none of their reports has been accepted.

    The value is when the first report was stored, wall time in ms since 1970.
    """
    found: dict[str, int] = {}
    for row in await connection.execute(_OLD_REPORTS, {"before_ms": wall_ms - UNKNOWN_AFTER_MS}):
        if json.loads(row.payload)["seq"] == 1:
            found[row.stream] = row.stored_wall_ms
    return found
