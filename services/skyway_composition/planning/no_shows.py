"""How often the drones of each provider did not come lately, for ranking offers.

Quotes and bookings ask many times a second, so the counts are a few seconds old.
"""

from collections.abc import Mapping
from datetime import timedelta
from typing import Final

from skyway.contracts.shortlist import Shortlist
from skyway.ids import ProviderId
from skyway.runtime.answer_cache import AnswerCache
from skyway.runtime.clock import FleetClock
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms
from skyway_composition.planning.no_show_store import COUNTED, no_shows_of

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
