"""All SQL that finds missions to look at, each second anew: statements are made once."""

from collections import defaultdict
from typing import Final

from sqlalchemy import and_, bindparam, or_, select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import DroneId, NetworkId
from skyway.runtime.clock import FleetClock
from skyway.runtime.sql.claims import NOW_MS, Claiming, claim_values
from skyway.runtime.sql.database import Database
from skyway_composition.tables import is_live, is_under_way, missions

#: Seconds of wall time after which others may plan for a mission, too: most plans are found in a
#: tenth of one, and of two revisions only the first is sent.
_CLAIMED_FOR_S: Final = 5.0

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
_STUCK: Final = Claiming.of(
    missions,
    where=and_(
        is_live,
        or_(missions.c.stuck.is_not(None), missions.c.trouble.is_not(None)),
        # What was proposed is answered first: two revisions on their way could cross.
        missions.c.proposal.is_(None),
        missions.c.retry_wall_ms <= NOW_MS,
    ),
    order_by=[missions.c.retry_wall_ms],
    # Whoever wants a plan at once from now on sets this to 0, and is not put off by this look.
    also={"retry_wall_ms": NOW_MS},
)


async def perhaps_overdue(
    connection: AsyncConnection, *, expired_ms: int, released_ms: int
) -> list[DroneId]:
    """Drones whose booking expired unanswered, or whose plan is long over."""
    wanted = {"expired_ms": expired_ms, "released_ms": released_ms}
    found = await connection.execute(_OVERDUE, wanted)
    return list(found.scalars())


async def perhaps_late(
    connection: AsyncConnection, *, ended_ms: int
) -> dict[NetworkId, list[DroneId]]:
    """Drones of which a step should have ended before a moment, and no trouble is known."""
    late: dict[NetworkId, list[DroneId]] = defaultdict(list)
    for row in await connection.execute(_LATE, {"ended_ms": ended_ms}):
        late[row.network_id].append(row.drone_id)
    return late


async def claim_stuck(db: Database, clock: FleetClock, claimant: str) -> list[DroneId]:
    """A few drones whose plans do not hold any more, now ours to plan for."""
    values = claim_values(limit=8, claimant=claimant, lease_s=_CLAIMED_FOR_S, clock=clock)
    rows = _STUCK.in_order(await db.write_alone(_STUCK.statement, values))
    return [row.drone_id for row in rows]
