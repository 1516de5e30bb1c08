"""Checks the plans of late missions before they lose their pads.

A late drone may not report that it is late. A plan avoids closures that begin later, but a drone
that comes later than planned may meet them.
"""

from dataclasses import dataclass

from skyway.ids import DroneId, NetworkId
from skyway.runtime.clock import FleetClock, fleet_margin
from skyway.runtime.loops import Wake
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork
from skyway_composition.missions.replanning.outlook.check_plan import REPORT_DELAY, check_plan
from skyway_composition.missions.replanning.remainder.closed_ahead import ClosedAhead
from skyway_composition.missions.timeouts.store import perhaps_late
from skyway_composition.networks.prepared import PreparedNetworks
from skyway_composition.planning.world import World


@dataclass(frozen=True, slots=True)
class LateMissions:
    """Checks missions with an overdue step; wakes `stuck` when one needs another plan."""

    db: Database
    networks: PreparedNetworks
    clock: FleetClock
    mint: Mint
    stuck: Wake

    async def step(self) -> bool:
        """Check the missions that are late now."""
        async with self.db.read() as connection:
            # The report about a step that has just ended may still be on its way.
            ended_at = self.clock.now() - fleet_margin(self.clock, **REPORT_DELAY)
            late = await perhaps_late(connection, ended_ms=moment_to_ms(ended_at))
        for network_id, drone_ids in late.items():
            closed = await self._closed(network_id)
            for drone_id in drone_ids:
                await self._judge(drone_id, closed)
        return False

    async def _closed(self, network_id: NetworkId) -> ClosedAhead:
        now_ms = moment_to_ms(self.clock.now())
        skyway = await self.networks.current(network_id)
        return ClosedAhead.of(await World.of(skyway, self.db, after_ms=now_ms), now_ms=now_ms)

    async def _judge(self, drone_id: DroneId, closed: ClosedAhead) -> None:
        async with self.db.write() as tx:
            work = await MissionUnitOfWork.lock([drone_id], tx=tx, clock=self.clock, mint=self.mint)
            record = work.missions.get(drone_id)
            if record is not None and (await check_plan(work, record, closed)).needs_plan:
                tx.after_commit(self.stuck.set)
