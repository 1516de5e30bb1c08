"""All SQL of the queue of missions that need another plan, and of missions that wait long."""

from datetime import timedelta
from typing import Final, NamedTuple

from sqlalchemy import and_, case, or_, select, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import DroneId, MissionId
from skyway.runtime.clock import FleetClock
from skyway.runtime.sql.claims import FREE, NOW_MS, Claiming, claim_values
from skyway.runtime.sql.database import Database, Tx
from skyway_composition.tables import is_live, is_under_way, mission_steps, missions, networks

#: Seconds of wall time until another replica may plan for a claimed mission. Most plans are found
#: in a tenth of a second. If two replicas plan for a mission, only the first revision is sent.
_CLAIMED_FOR_S: Final = 5.0


_STUCK: Final = Claiming.of(
    missions,
    where=and_(
        is_live,
        or_(missions.c.stuck.is_not(None), missions.c.trouble.is_not(None)),
        # A proposal is answered first: two revisions on their way could overtake each other.
        missions.c.proposal.is_(None),
        missions.c.retry_wall_ms <= NOW_MS,
    ),
    order_by=[missions.c.retry_wall_ms],
    # A request for a plan sets this to 0; this planning does not put such a later request off.
    also={"retry_wall_ms": NOW_MS},
)


async def claim_stuck(db: Database, clock: FleetClock, claimant: str) -> list[DroneId]:
    """Claim a few missions that need another plan; returns their drones."""
    values = claim_values(limit=8, claimant=claimant, lease_s=_CLAIMED_FOR_S, clock=clock)
    rows = _STUCK.in_order(await db.write_alone(_STUCK.statement, values))
    return [row.drone_id for row in rows]


async def retry_stuck(tx: Tx, mission_id: MissionId, *, at_wall_ms: int) -> None:
    """Release the claim of a mission that needs a plan; plan again at this moment."""
    await tx.execute(
        update(missions)
        .where(missions.c.mission_id == mission_id)
        .values(retry_wall_ms=at_wall_ms, **FREE)
    )


async def put_off(tx: Tx, mission_id: MissionId, *, until_wall_ms: int) -> None:
    """Release the claim of a mission; plan again then, or now if a plan was requested meanwhile."""
    retry_ms = case((missions.c.retry_wall_ms == 0, 0), else_=until_wall_ms)
    await tx.execute(
        update(missions)
        .where(missions.c.mission_id == mission_id)
        .values(retry_wall_ms=retry_ms, **FREE)
    )


async def plan_now(tx: Tx, mission_id: MissionId) -> None:
    """Plan without waiting any longer; a replica that has claimed the mission keeps its claim."""
    await tx.execute(
        update(missions).where(missions.c.mission_id == mission_id).values(retry_wall_ms=0)
    )


class Waiting(NamedTuple):
    """A mission that waits, or will, and the network's present version and conditions."""

    mission_id: MissionId
    drone_id: DroneId
    version: int
    conditions: int


async def waiting(
    connection: AsyncConnection, *, at_ms: int, for_: timedelta
) -> frozenset[Waiting]:
    """The missions under way whose plans wait for so long after this moment, or longer."""
    step, for_ms = mission_steps.c, for_ // timedelta(milliseconds=1)
    query = (
        select(
            missions.c.mission_id, missions.c.drone_id, networks.c.version, networks.c.conditions
        )
        .join(networks, networks.c.network_id == missions.c.network_id)
        .join(mission_steps, step.mission_id == missions.c.mission_id)
        .where(is_under_way, step.kind == "WAIT", step.status == "PLANNED")
        .where(step.planned_end_ms - step.planned_start_ms >= for_ms)
        .where(step.planned_end_ms >= at_ms + for_ms)
        .distinct()
    )
    return frozenset(Waiting(*row) for row in await connection.execute(query))
