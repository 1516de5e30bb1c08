"""Ends missions whose drones wait too long for a loader."""

from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Final

from skyway.contracts.flight_step import PickUpStep
from skyway.runtime.clock import FleetClock, fleet_margin
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms
from skyway_composition.missions.interventions.confirm_loading import LoadingFault, refuse_loading
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.step_store import steps_of
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork
from skyway_composition.missions.timeouts import store
from skyway_composition.missions.timeouts.store import AwaitedLoading
from skyway_composition.networks.prepared import PreparedNetworks

#: The least wall time, in seconds, that a loader has. On a fast clock a program confirms, and its
#: request and our answer may take longer than half an hour of fleet time. Our own choice.
_LEAST_WALL_S: Final = 10.0


@dataclass(frozen=True, slots=True)
class LoadingTimeouts:
    """Ends missions that nobody has loaded in time."""

    db: Database
    networks: PreparedNetworks
    clock: FleetClock
    mint: Mint

    async def step(self) -> bool:
        """End the missions that have waited too long."""
        now_ms = moment_to_ms(self.clock.now())
        async with self.db.read() as connection:
            awaited = await store.awaited_loadings(connection, started_before_ms=now_ms)
        for each in awaited:
            skyway = await self.networks.current(each.network_id)
            timeout_s = skyway.settings.loading_timeout_s
            timeout = fleet_margin(self.clock, fleet_s=timeout_s, wall_s=_LEAST_WALL_S)
            # A drone that has started later than this cannot have waited that long.
            if each.start_ms <= moment_to_ms(self.clock.now() - timeout):
                await self._judge(each, timeout)
        return False

    async def _judge(self, awaited: AwaitedLoading, timeout: timedelta) -> None:
        async with self.db.write() as tx:
            work = await MissionUnitOfWork.lock(
                [awaited.drone_id], tx=tx, clock=self.clock, mint=self.mint
            )
            record = work.missions.get(awaited.drone_id)
            if record is None or record.mission_id != awaited.mission_id:
                return
            since = await _loading_since(work, record)
            if since is None or self.clock.now() < since + timeout:
                return
            detail = f"no loader has confirmed since {since.isoformat()}"
            fault = LoadingFault("LOADING_TIMEOUT", detail, {"timeout_s": timeout.total_seconds()})
            await refuse_loading(work, record, fault)


async def _loading_since(work: MissionUnitOfWork, record: MissionRecord) -> datetime | None:
    """Since when the drone waits for a loader; None while it does not wait for one.

    A drone that has not begun, is held by an operator, or waits for a plan does not wait for a
    loader.
    """
    mission = record.mission
    is_awaited = (mission.state, mission.loading) == ("ACTIVE", "AWAITED")
    if not is_awaited or record.is_being_loaded or mission.is_held or record.stuck is not None:
        return None
    since = record.mission.start_at
    for each in await steps_of(work.tx.connection, record.mission_id):
        if each.status == "ENDED" and each.event is not None:
            since = max(since, each.event.ended_at)
        elif isinstance(each.step, PickUpStep):
            return max(since, each.step.planned_start_at)
        else:
            return None
    return None
