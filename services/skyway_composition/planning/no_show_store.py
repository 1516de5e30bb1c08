"""No-shows: how many missions of a provider ended lately because their drones did not come.

Quotes and bookings ask many times a second, so the counts are a few seconds old.
"""

from collections.abc import Mapping
from datetime import timedelta
from typing import Final

from sqlalchemy import func, insert, select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.mission import Mission
from skyway.contracts.shortlist import Shortlist
from skyway.ids import ProviderId
from skyway.runtime.answer_cache import AnswerCache
from skyway.runtime.clock import FleetClock
from skyway.runtime.sql.database import Database, Tx
from skyway.units import moment_to_ms
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


#: How old the counts are at most, wall time.
_KEPT: Final = timedelta(seconds=5)

#: All counts are the answer to one question.
_ALL: Final = "all"


class NoShows:
    """Counts the no-shows of each provider."""

    def __init__(self, db: Database, clock: FleetClock) -> None:
        self._db = db
        self._clock = clock
        self._counts = AnswerCache(self._count, clock=clock, kept=_KEPT, most=1)

    async def marked(self, shortlist: Shortlist) -> Shortlist:
        """The shortlist with the no-shows of its providers."""
        counts = self._counts.cached(_ALL)
        if counts is None:
            counts = await self._counts.ask(_ALL)
        return shortlist.with_no_shows(counts)

    async def _count(self, _question: str) -> Mapping[ProviderId, int]:
        async with self._db.read() as connection:
            since_ms = moment_to_ms(self._clock.now() - COUNTED)
            return await no_shows_of(connection, since_ms=since_ms)
