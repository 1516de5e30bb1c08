"""All SQL that finds missions to look at."""

from sqlalchemy import and_, func, or_, select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import DroneId
from skyway.runtime.claims import claim
from skyway.runtime.clock import FleetClock
from skyway.runtime.database import Database
from skyway.units import moment_to_ms
from skyway_composition.tables import is_live, mission_steps, missions


async def perhaps_overdue(
    connection: AsyncConnection, *, expired_ms: int, released_ms: int
) -> list[DroneId]:
    """Drones whose booking expired unanswered, or whose plan is long over."""
    found = await connection.execute(
        select(missions.c.drone_id)
        .where(
            or_(
                and_(missions.c.state == "BOOKED", missions.c.expires_ms < expired_ms),
                and_(
                    is_live,
                    missions.c.released_ms < released_ms,
                ),
            )
        )
        .order_by(missions.c.drone_id)
    )
    return list(found.scalars())


async def perhaps_late(connection: AsyncConnection, *, ended_ms: int) -> list[DroneId]:
    """Drones of which a step should have ended before a moment, and no trouble is known."""
    # Asked of each mission by its key: for EXISTS, PostgreSQL compares all missions with all steps
    # for as long as it takes the tables to be small.
    first_end_ms = (
        select(func.min(mission_steps.c.planned_end_ms))
        .where(
            mission_steps.c.mission_id == missions.c.mission_id,
            mission_steps.c.status == "PLANNED",
        )
        .scalar_subquery()
    )
    found = await connection.execute(
        select(missions.c.drone_id)
        .where(
            missions.c.state.in_(("ACCEPTED", "ACTIVE")),
            missions.c.stuck.is_(None),
            missions.c.trouble.is_(None),
            missions.c.proposal.is_(None),
            first_end_ms < ended_ms,
        )
        .order_by(missions.c.drone_id)
    )
    return list(found.scalars())


async def claim_stuck(db: Database, clock: FleetClock, claimant: str) -> list[DroneId]:
    """A few drones whose plans do not hold any more, now ours to plan for."""
    rows = await claim(
        db,
        missions,
        where=and_(
            is_live,
            or_(missions.c.stuck.is_not(None), missions.c.trouble.is_not(None)),
            # What was proposed is answered first: two revisions on their way could cross.
            missions.c.proposal.is_(None),
            missions.c.retry_wall_ms <= moment_to_ms(clock.wall_now()),
        ),
        order_by=[missions.c.retry_wall_ms],
        limit=8,
        claimant=claimant,
        lease_s=30.0,
        clock=clock,
    )
    return [row.drone_id for row in rows]
