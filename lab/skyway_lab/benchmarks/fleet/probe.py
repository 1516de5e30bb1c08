"""How old the newest states are when they can be read in the services' databases."""

import asyncio
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Final

import asyncpg

#: Between two looks, wall seconds: what is found may have been there for so long.
_EVERY_S: Final = 0.1

#: Wall seconds in which all must be in time for services to count as having caught up.
_CALM_S: Final = 5.0

#: Each: drone, (session, seq) as one text, the moment of the message in fleet ms.
_REGISTRY_STATES: Final = """
    SELECT drone_id, state_session || '/' || state_seq AS place, state_at_ms AS at_ms
    FROM presence WHERE drone_id = ANY($1::text[])
"""
_REGISTRY_SAMPLES: Final = """
    SELECT drone_id, sample_session || '/' || sample_seq AS place, sample_at_ms AS at_ms
    FROM presence WHERE drone_id = ANY($1::text[])
"""
_COMPOSITION_STATES: Final = """
    SELECT drone_id, (said->>'session') || '/' || (said->>'seq') AS place,
        extract(epoch FROM (said->>'at')::timestamptz) * 1000 AS at_ms
    FROM (SELECT drone_id, state::json AS said FROM drone_links) AS links
    WHERE drone_id = ANY($1::text[])
"""

#: What is asked of which database, by the name under which it is printed.
_ASKED: Final = {
    "registry, states": ("registry", _REGISTRY_STATES),
    "registry, samples": ("registry", _REGISTRY_SAMPLES),
    "composition, states": ("composition", _COMPOSITION_STATES),
}


@dataclass(slots=True)
class Lag:
    """Of some drones' messages of one kind: seconds from writing to where others can read it."""

    seconds: list[float] = field(default_factory=list)
    _known: dict[str, str] = field(default_factory=dict)

    def notice(self, drone_id: str, place: str, *, age_s: float) -> None:
        """Note what can be read now; what could be read before is no news."""
        if self._known.get(drone_id, place) != place:
            self.seconds.append(age_s)
        self._known[drone_id] = place

    def begin(self) -> None:
        """Count anew."""
        self.seconds = []


async def wait_caught_up(lags: Mapping[str, Lag], *, limit_s: float, within_s: float) -> float:
    """Return once nothing new is older than the limit, or not within this time; after how long."""
    loop = asyncio.get_running_loop()
    began_s = loop.time()
    while (passed_s := loop.time() - began_s) < within_s:
        for lag in lags.values():
            lag.begin()
        await asyncio.sleep(_CALM_S)
        if all(lag.seconds and max(lag.seconds) < limit_s for lag in lags.values()):
            break
    return passed_s


@asynccontextmanager
async def probing(
    database_urls: dict[str, str], drone_ids: Sequence[str]
) -> AsyncIterator[dict[str, Lag]]:
    """Look at these drones in PostgreSQL again and again while the block lasts.

    The clock rate is 1: fleet time is wall time.
    """
    lags = {name: Lag() for name in _ASKED}
    async with asyncio.TaskGroup() as group:
        looking = [
            group.create_task(_look(database_urls[service], query, drone_ids, lags[name]))
            for name, (service, query) in _ASKED.items()
        ]
        try:
            yield lags
        finally:
            for task in looking:
                task.cancel()


async def _look(url: str, query: str, drone_ids: Sequence[str], lag: Lag) -> None:
    connection = await asyncpg.connect(url)
    try:
        while True:
            rows = await connection.fetch(query, list(drone_ids))
            now_ms = 1e3 * datetime.now(UTC).timestamp()
            for row in rows:
                if row["at_ms"] is not None:
                    age_s = (now_ms - float(row["at_ms"])) / 1e3
                    lag.notice(row["drone_id"], row["place"], age_s=age_s)
            await asyncio.sleep(_EVERY_S)
    finally:
        await connection.close()
