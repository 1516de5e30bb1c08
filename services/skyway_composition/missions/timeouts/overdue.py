"""Ends missions of silent drones: within a bounded time, but never while they may fly."""

import logging
from dataclasses import dataclass
from datetime import datetime
from typing import Final

from skyway.ids import DroneId
from skyway.runtime.clock import FleetClock, fleet_margin
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition.links.link import DroneLink
from skyway_composition.missions.mission.end import abort, refuse
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork
from skyway_composition.missions.timeouts.store import perhaps_overdue

log = logging.getLogger(__name__)

#: Longest time from the broker's receipt of an ack until it is handled here, wall seconds. After a
#: longer pause the broker drops the connection of this process, which then asks for events again.
_ACK_ON_ITS_WAY_S: Final = 10.0


def _is_certainly_not_flown(
    record: MissionRecord, link: DroneLink, *, ack_due_at: datetime
) -> bool:
    """Whether the drone surely does not fly an expired booking that it did not answer.

    Either the drone is disconnected, and an ack from before the expiry would have arrived by now.
    Or it has reported since the expiry that it does something else. Until then a second drone for
    the delivery could mean two deliveries.
    """
    if link.is_gone and moment_to_ms(ack_due_at) > record.expires_ms:
        return True
    state = link.state
    return (
        state is not None
        and moment_to_ms(state.at) > record.expires_ms
        and state.mission_id != record.mission_id
    )


def is_silent(record: MissionRecord, link: DroneLink, *, since: datetime) -> bool:
    """Whether the drone has not reported since this moment that it flies this mission."""
    state = link.state
    return state is None or state.at < since or state.mission_id != record.mission_id


@dataclass(frozen=True, slots=True)
class OverdueMissions:
    """Ends missions whose time is over."""

    db: Database
    clock: FleetClock
    mint: Mint

    async def step(self) -> bool:
        """End the missions that are overdue now."""
        now = self.clock.now()
        longest_wait = fleet_margin(self.clock, fleet_s=3_600, wall_s=120)
        async with self.db.read() as connection:
            drone_ids = await perhaps_overdue(
                connection,
                expired_ms=moment_to_ms(now),
                released_ms=moment_to_ms(now - longest_wait),
            )
        for drone_id in drone_ids:
            await self._judge(drone_id, silent_since=now - longest_wait)
        return False

    async def _judge(self, drone_id: DroneId, *, silent_since: datetime) -> None:
        async with self.db.write() as tx:
            work = await MissionUnitOfWork.lock([drone_id], tx=tx, clock=self.clock, mint=self.mint)
            record, link = work.missions.get(drone_id), work.links.get(drone_id)
            if record is None or link is None:
                return
            now = self.clock.now()
            has_expired = moment_to_ms(now) > record.expires_ms
            is_long_over = record.mission.released_at < silent_since
            if record.mission.state == "BOOKED" and has_expired:
                ack_due_at = now - fleet_margin(self.clock, fleet_s=0, wall_s=_ACK_ON_ITS_WAY_S)
                if _is_certainly_not_flown(record, link, ack_due_at=ack_due_at) or is_long_over:
                    expired_at = ms_to_moment(record.expires_ms)
                    detail = f"the drone did not answer until {expired_at.isoformat()}"
                    await refuse(work, record, code="NO_ANSWER", detail=detail)
            elif is_long_over and record.stuck is not None:
                detail = f"no plan for the remainder was found: {record.stuck.detail}"
                await abort(work, record, at=now, code=record.stuck.code, detail=detail)
            elif is_long_over and is_silent(record, link, since=silent_since):
                detail = "the drone has sent no message"
                await abort(work, record, at=now, code="SILENT", detail=detail)
