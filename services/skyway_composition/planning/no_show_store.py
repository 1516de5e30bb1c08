"""The SQL of no-shows: missions that ended because their drones did not come."""

from collections.abc import Mapping
from datetime import timedelta
from typing import Final

from sqlalchemy import func, insert, select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.mission import Mission
from skyway.ids import ProviderId
from skyway.runtime.sql.database import Tx
from skyway_composition.tables import no_shows

#: How long a no-show counts, fleet time. Our own choice.
COUNTED: Final = timedelta(days=7)

#: The codes with which such missions end. A drone that refuses a mission, or says that it cannot go
#: on, has come.
_ABSENCES: Final = frozenset({"NO_ANSWER", "SILENT"})


async def note_absence(tx: Tx, mission: Mission, *, code: str, at_ms: int) -> None:
    """Note that a mission has ended with this code, if its drone did not come; fleet time."""
    if code not in _ABSENCES:
        return
    row = {
        "mission_id": mission.mission_id,
        "provider_id": mission.provider_id,
        "drone_id": mission.drone_id,
        "code": code,
        "at_ms": at_ms,
    }
    await tx.execute(insert(no_shows).values(row))


async def no_shows_of(
    connection: AsyncConnection, *, since_ms: int, provider_id: ProviderId | None = None
) -> Mapping[ProviderId, int]:
    """By provider: the no-shows since then, fleet time; of one provider, or of all."""
    statement = select(no_shows.c.provider_id, func.count()).where(no_shows.c.at_ms >= since_ms)
    if provider_id is not None:
        statement = statement.where(no_shows.c.provider_id == provider_id)
    found = await connection.execute(statement.group_by(no_shows.c.provider_id))
    return {ProviderId(row[0]): int(row[1]) for row in found}
