"""Composition's mission reports: those that arrive together are kept in one transaction.

A transaction costs several times what a report in it does, and a report is a hint that may come a
little later: composition's own index decides which drones are busy.
"""

import asyncio
from collections.abc import Iterable
from dataclasses import dataclass, field

from skyway.contracts.mission import MissionReport
from skyway.runtime.clock import FleetClock
from skyway.runtime.pace import Pace
from skyway.runtime.sql.database import Database
from skyway_provider_registry.presence.mission_hint_store import record_reports


@dataclass(slots=True)
class _Batch:
    """Reports that share a transaction, from the first that waits until they are on disk."""

    reports: list[MissionReport] = field(default_factory=list)
    is_kept: bool = False


class ReportKeeper:
    """Keeps what reports say of drones; the one that waits longest writes for all that wait."""

    def __init__(self, db: Database, clock: FleetClock, pace: Pace) -> None:
        self._db = db
        self._clock = clock
        self._pace = pace
        self._writing = asyncio.Lock()
        self._next = _Batch()

    async def keep(self, reports: Iterable[MissionReport]) -> None:
        """Return once the reports are on disk; one that is known, or of no drone, is nothing."""
        batch = self._next
        batch.reports.extend(reports)
        async with self._writing:
            # Else somebody has written it; who failed to leaves it to the next that waits for it.
            if not batch.is_kept:
                await self._write(batch)

    async def _write(self, batch: _Batch) -> None:
        await self._pace.turn()
        if self._next is batch:
            self._next = _Batch()
        async with self._db.write() as tx:
            await record_reports(tx, batch.reports, wall_at=self._clock.wall_now())
        batch.is_kept = True
