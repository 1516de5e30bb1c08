"""Enforces ground stops: the next take-off of a mission changes as the mission goes on."""

from dataclasses import dataclass

from skyway.runtime.clock import FleetClock
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms
from skyway_composition.closures.close import Closings
from skyway_composition.closures.closure import Closure
from skyway_composition.closures.store import ground_stops
from skyway_composition.missions.closure_impact import store


@dataclass(frozen=True, slots=True)
class GroundStopEnforcer:
    """Requests other plans for missions whose next take-off a ground stop now forbids."""

    db: Database
    closings: Closings
    clock: FleetClock

    async def step(self) -> bool:
        """Check all ground stops that are in force."""
        async with self.db.read() as connection:
            stops = await ground_stops(connection, at_ms=moment_to_ms(self.clock.now()))
        for stop in stops:
            await self._enforce(stop)
        return False

    async def _enforce(self, stop: Closure) -> None:
        reach = await self.closings.reach(stop)
        hit = await self.closings.impact.preview(self.db, reach)
        async with self.db.read() as connection:
            unaware = await store.without_trouble(connection, [each.mission_id for each in hit])
        if unaware:
            async with self.db.write() as tx:
                await self.closings.impact.apply(tx, reach)
