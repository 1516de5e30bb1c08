"""Missions that are late without saying so: their plans are looked at before pads are lost."""

from dataclasses import dataclass

from skyway.ids import DroneId
from skyway.runtime.clock import FleetClock, fleet_margin
from skyway.runtime.loops import Wake
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms
from skyway_composition.missions.outlook.judging import ON_ITS_WAY, judged
from skyway_composition.missions.sweeps.store import perhaps_late
from skyway_composition.missions.watch import Watch


@dataclass(frozen=True, slots=True)
class Lagging:
    """Sweeps missions of which a step is overdue; `stuck` is woken when one needs another plan."""

    db: Database
    clock: FleetClock
    mint: Mint
    stuck: Wake

    async def step(self) -> bool:
        """Look at what is overdue now."""
        async with self.db.read() as connection:
            # What has just ended may still be on its way to us.
            ended_at = self.clock.now() - fleet_margin(self.clock, **ON_ITS_WAY)
            drone_ids = await perhaps_late(connection, ended_ms=moment_to_ms(ended_at))
        for drone_id in drone_ids:
            await self._judge(drone_id)
        return False

    async def _judge(self, drone_id: DroneId) -> None:
        async with self.db.write() as tx:
            watch = await Watch.over([drone_id], tx=tx, clock=self.clock, mint=self.mint)
            record = watch.missions.get(drone_id)
            if record is not None and (await judged(watch, record)).needs_plan:
                tx.after_commit(self.stuck.set)
