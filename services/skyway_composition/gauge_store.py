"""All SQL of composition's gauges and rests; no statement reads what is over."""

from typing import Final

from sqlalchemy import exists, func, select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway_composition.tables import (
    alarms,
    closures,
    is_live,
    is_open,
    missions,
    offer_holds,
    outbox,
    quarantine,
)

_OPEN: Final = select(missions.c.state, func.count()).where(is_open).group_by(missions.c.state)
_STUCK: Final = select(func.count()).where(is_live, missions.c.stuck.is_not(None))
_ALARMS: Final = (
    select(alarms.c.level, alarms.c.code, func.count())
    .where(alarms.c.acknowledged_ms.is_(None))
    .group_by(alarms.c.level, alarms.c.code)
)
_QUARANTINED: Final = select(func.count()).select_from(quarantine)

#: While there are such rows, time alone can make work for the loops.
OPEN_ROWS: Final = (
    exists(select(missions).where(is_open)),
    exists(select(offer_holds)),
    exists(select(closures).where(closures.c.lifted_ms.is_(None))),
    exists(select(outbox)),
)


async def open_missions(connection: AsyncConnection) -> dict[str, int]:
    """The number of missions that are not over, by state."""
    return dict((await connection.execute(_OPEN)).all())


async def stuck_missions(connection: AsyncConnection) -> int:
    """The number of missions that wait for a new plan."""
    return int((await connection.execute(_STUCK)).scalar_one())


async def open_alarms(connection: AsyncConnection) -> dict[tuple[str, str], int]:
    """The number of alarms that nobody has acknowledged, by level and code."""
    rows = await connection.execute(_ALARMS)
    return {(level, code): alarm_count for level, code, alarm_count in rows}


async def quarantined_messages(connection: AsyncConnection) -> int:
    """The number of messages in the quarantine."""
    return int((await connection.execute(_QUARANTINED)).scalar_one())
