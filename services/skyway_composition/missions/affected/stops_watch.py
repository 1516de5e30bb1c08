"""Watching ground stops: which take-off comes next is known only as missions go on."""

from dataclasses import dataclass

from skyway.runtime.clock import FleetClock
from skyway.runtime.database import Database
from skyway.runtime.loops import Wake
from skyway.runtime.minting import Mint
from skyway.units import moment_to_ms
from skyway_composition.closures.closing import Closings
from skyway_composition.closures.closure import Closure
from skyway_composition.closures.store import ground_stops
from skyway_composition.missions.affected import store
from skyway_composition.missions.affected.ground_stops import let_go


@dataclass(frozen=True, slots=True)
class StopsWatch:
    """Holds drones whose next take-off is forbidden by now; lets them go when a stop is over."""

    db: Database
    closings: Closings
    clock: FleetClock
    mint: Mint
    stuck: Wake

    async def step(self) -> bool:
        """Look at all ground stops once."""
        now_ms = moment_to_ms(self.clock.now())
        async with self.db.read() as connection:
            over = await store.stops_over(connection, now_ms=now_ms)
            in_force = await ground_stops(connection, at_ms=now_ms)
        if over:
            async with self.db.write() as tx:
                await let_go(tx, over, clock=self.clock, mint=self.mint)
                tx.after_commit(self.stuck.set)
        for stop in in_force:
            await self._enforce(stop)
        return False

    async def _enforce(self, stop: Closure) -> None:
        reach = await self.closings.reach(stop)
        hit = await self.closings.impact.preview(self.db, reach)
        async with self.db.read() as connection:
            stopped = await store.stopped_by(connection, [stop.closure_id])
        if any(each.mission_id not in stopped for each in hit):
            async with self.db.write() as tx:
                await self.closings.impact.strike(tx, reach)
