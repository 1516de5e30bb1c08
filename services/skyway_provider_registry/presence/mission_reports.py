"""Stores composition's mission reports: reports that arrive together share a transaction.

A transaction costs several times as much as a report. A report is only a hint, so it may be stored
a little later: composition's own index decides which drones are busy.
"""

import asyncio
from collections.abc import Iterable
from dataclasses import dataclass, field

from skyway.contracts.mission_reports import MissionReport
from skyway.runtime.clock import FleetClock
from skyway.runtime.pace import Pace
from skyway.runtime.sql.database import Database
from skyway_provider_registry.presence.mission_hint_store import store_reports


@dataclass(slots=True)
class _Batch:
    """Reports that share a transaction; `is_stored` once they are on disk."""

    reports: list[MissionReport] = field(default_factory=list)
    is_stored: bool = False


class ReportKeeper:
    """Stores reports; the caller that waits longest writes for all callers that wait."""

    def __init__(self, db: Database, clock: FleetClock, pace: Pace) -> None:
        self._db = db
        self._clock = clock
        self._pace = pace
        self._writing = asyncio.Lock()
        self._next = _Batch()

    async def keep(self, reports: Iterable[MissionReport]) -> None:
        """Return once the reports are on disk; repeated reports and unknown drones are ignored."""
        batch = self._next
        batch.reports.extend(reports)
        async with self._writing:
            # Another caller may have stored the batch. After a failure the next caller tries again.
            if not batch.is_stored:
                await self._write(batch)

    async def _write(self, batch: _Batch) -> None:
        await self._pace.turn()
        if self._next is batch:
            self._next = _Batch()
        async with self._db.write() as tx:
            await store_reports(tx, batch.reports, wall_at=self._clock.wall_now())
        batch.is_stored = True
