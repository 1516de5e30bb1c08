"""Plays the reports of test deliveries, as composition would send them.

First it is stored that a report has happened, then the report is applied. After a kill between the
two, the next step applies all reports that have happened, and those that were applied change
nothing. So two replicas may play the same mission.
"""

from collections.abc import Awaitable, Callable
from dataclasses import dataclass, replace
from datetime import timedelta
from typing import Final

from skyway.contracts.mission_reports import MissionReport
from skyway.ids import MissionId
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import Conflict, NotFound
from skyway.runtime.sql.database import Database
from skyway_gateway.sandbox import store
from skyway_gateway.sandbox.sandbox_composition import PACE, PROOF_WAIT
from skyway_gateway.sandbox.store import SandboxMission

#: Missions of one step.
_BATCH: Final = 100


@dataclass(frozen=True, slots=True)
class Player:
    """Plays reports; `apply` applies a report to its delivery, once."""

    db: Database
    clock: FleetClock
    apply: Callable[[MissionReport], Awaitable[None]]

    async def step(self) -> bool:
        """Play the reports that are due; True if there may be more."""
        async with self.db.read() as connection:
            found = await store.due(connection, at=self.clock.wall_now(), limit=_BATCH)
        for mission_id in found:
            await self._play(mission_id)
        return len(found) == _BATCH

    async def _play(self, mission_id: MissionId) -> None:
        async with self.db.write() as tx:
            before = await store.locked(tx, mission_id)
            if before is None:
                return
            now = replace(before, played=min(before.played + 1, len(before.reports)))
            await store.save(tx, now, next_at=self.clock.wall_now() + _pause_after(now))
        if await self._applied(now) and before.is_over:
            async with self.db.write() as tx:
                last = await store.locked(tx, mission_id)
                if last is not None and last.is_over:
                    await store.save(tx, last, next_at=None)

    async def _applied(self, now: SandboxMission) -> bool:
        """Apply all reports that have happened; False if one has to be repeated later."""
        happened = now.reports[: now.played]
        try:
            try:
                await self.apply(happened[-1])
            except Conflict:  # an earlier one is missing
                for report in happened:
                    await self.apply(report)
        except NotFound:
            return True  # the delivery was deleted
        except Conflict:
            return False  # the booking is not written yet
        return True


def _pause_after(now: SandboxMission) -> timedelta:
    """How long after the last report the next one comes, wall time."""
    last, *following = now.reports[now.played - 1 :]
    goes_on = bool(following) and following[0].kind == "PIN_ENTERED"
    return PROOF_WAIT if last.kind == "PROOF_AWAITED" and not goes_on else PACE
