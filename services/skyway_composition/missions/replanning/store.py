"""All SQL of the queue of missions that wait for another plan."""

from collections.abc import Iterable
from typing import Final

from sqlalchemy import and_, bindparam, case, or_, update

from skyway.ids import DroneId, MissionId
from skyway.runtime.clock import FleetClock
from skyway.runtime.sql.claims import FREE, NOW_MS, Claiming, claim_values
from skyway.runtime.sql.database import Database, Tx
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.tables import is_live, missions

#: Seconds of wall time after which others may plan for a mission, too: most plans are found in a
#: tenth of one, and of two revisions only the first is sent.
_CLAIMED_FOR_S: Final = 5.0


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


async def claim_stuck(db: Database, clock: FleetClock, claimant: str) -> list[DroneId]:
    """A few drones whose plans do not hold any more, now ours to plan for."""
    values = claim_values(limit=8, claimant=claimant, lease_s=_CLAIMED_FOR_S, clock=clock)
    rows = _STUCK.in_order(await db.write_alone(_STUCK.statement, values))
    return [row.drone_id for row in rows]


async def retry_stuck(tx: Tx, mission_id: MissionId, *, at_wall_ms: int) -> None:
    """Give up the claim of a mission that waits for a revision; look again at this moment."""
    await tx.execute(
        update(missions)
        .where(missions.c.mission_id == mission_id)
        .values(retry_wall_ms=at_wall_ms, **FREE)
    )


async def put_off(tx: Tx, mission_id: MissionId, *, until_wall_ms: int) -> None:
    """Give up the claim of a mission; look again then, or at once if that is wanted by now."""
    wanted_ms = case((missions.c.retry_wall_ms == 0, 0), else_=until_wall_ms)
    await tx.execute(
        update(missions)
        .where(missions.c.mission_id == mission_id)
        .values(retry_wall_ms=wanted_ms, **FREE)
    )


async def save_troubles(tx: Tx, records: Iterable[MissionRecord]) -> None:
    """Keep the troubles of missions that are locked, and what was told of them; plan at once."""
    rows = [
        {
            "of_mission": record.mission_id,
            "trouble": None if record.trouble is None else record.trouble.model_dump_json(),
            "report_seq": record.report_seq,
        }
        for record in records
    ]
    if rows:
        of_mission = missions.c.mission_id == bindparam("of_mission")
        await tx.execute(update(missions).where(of_mission).values(retry_wall_ms=0), rows)


async def plan_now(tx: Tx, mission_id: MissionId) -> None:
    """Look for a plan without waiting any longer; whoever is at it keeps the claim."""
    await tx.execute(
        update(missions).where(missions.c.mission_id == mission_id).values(retry_wall_ms=0)
    )
