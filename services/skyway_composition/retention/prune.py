"""Deletes old closures, acknowledged alarms and versions of networks, as the settings ask for it.

Deliveries are deleted when the gateway asks for it (`forget_routes`).
"""

from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from datetime import timedelta
from typing import Final

from skyway.runtime.clock import FleetClock
from skyway.runtime.loops import Loops, repeat
from skyway.runtime.replicas.membership import LeaderStep, Membership
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms
from skyway_composition import alarm_store
from skyway_composition.closures import store as closure_store
from skyway_composition.networks import store as network_store
from skyway_composition.settings import CompositionSettings

#: Seconds of wall time between two steps.
_EVERY_S: Final = 60.0


@dataclass(frozen=True, slots=True)
class Pruning:
    """Deletes closures, alarms and versions after a span of fleet time; None keeps them."""

    db: Database
    clock: FleetClock
    closures_kept: timedelta | None
    alarms_kept: timedelta | None
    versions_kept: timedelta | None = None

    async def step(self) -> bool:
        """Delete some of each; whether there may be more."""
        more_closures = await self._delete(closure_store.delete_over, self.closures_kept)
        more_alarms = await self._delete(alarm_store.delete_acknowledged, self.alarms_kept)
        more_versions = await self._delete(network_store.delete_replaced, self.versions_kept)
        return more_closures or more_alarms or more_versions

    async def _delete(self, delete: Callable[..., Awaitable[bool]], kept: timedelta | None) -> bool:
        if kept is None:
            return False
        async with self.db.write() as tx:
            return await delete(tx, before_ms=moment_to_ms(self.clock.now() - kept))


def start_pruning(
    loops: Loops,
    membership: Membership,
    db: Database,
    clock: FleetClock,
    settings: CompositionSettings,
) -> None:
    """Start the loop in which the leader deletes rows that are older than the settings keep."""
    days = settings.closure_days, settings.alarm_days, settings.network_version_days
    kept = [None if each is None else timedelta(days=each) for each in days]
    pruning = Pruning(db, clock, *kept)
    step = LeaderStep(membership, pruning.step)
    loops.start("old rows", repeat("old rows", step, every_s=_EVERY_S))
