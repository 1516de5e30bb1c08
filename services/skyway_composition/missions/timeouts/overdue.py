"""Handles missions of silent drones: ends those that surely are not flown, doubts the others.

No clock ends a mission whose drone may have the packages. Such a mission is put in doubt, and
waits for its drone or for an operator.
"""

import logging
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Final

from skyway.ids import DroneId
from skyway.runtime.clock import FleetClock, fleet_margin
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition.links.link import DroneLink
from skyway_composition.links.listening import Listening
from skyway_composition.missions.mission.doubt import put_in_doubt
from skyway_composition.missions.mission.end import abort, refuse
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork
from skyway_composition.missions.timeouts.evidence import says_not_flown, silence_proves_not_flown
from skyway_composition.missions.timeouts.store import perhaps_overdue

log = logging.getLogger(__name__)

#: Longest time from the broker's receipt of an ack until it is handled here, wall seconds. After a
#: longer pause the broker drops the connection of this process, which then asks for events again.
_ACK_ON_ITS_WAY_S: Final = 10.0


def is_silent(record: MissionRecord, link: DroneLink, *, since: datetime) -> bool:
    """Whether the drone has not reported since this moment that it flies this mission."""
    state = link.state
    return state is None or state.at < since or state.mission_id != record.mission_id


@dataclass(frozen=True, slots=True)
class OverdueMissions:
    """Judges missions whose time is over."""

    db: Database
    clock: FleetClock
    mint: Mint
    listening: Listening

    async def step(self) -> bool:
        """Judge the missions that are overdue now."""
        self.listening.look()
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
            if link.has_unread_events:
                # The events decide. A drone that does not send them keeps its mission.
                work.links[drone_id] = link = await work.courier.ask_for_events(tx, link)
            is_long_over = record.mission.released_at < silent_since
            if record.mission.state == "BOOKED":
                await self._judge_booking(work, record, link)
            elif is_long_over and record.stuck is not None and not link.has_unread_events:
                detail = f"no plan for the remainder was found: {record.stuck.detail}"
                now = self.clock.now()
                await abort(work, record, at=now, code=record.stuck.code, detail=detail)
            elif is_long_over and is_silent(record, link, since=silent_since):
                detail = "the drone has sent no message about the mission since its planned end"
                await put_in_doubt(work, record, code="SILENT", detail=detail)

    async def _judge_booking(
        self, work: MissionUnitOfWork, record: MissionRecord, link: DroneLink
    ) -> None:
        """Refuse an expired booking that is surely not flown; doubt it when no answer comes."""
        now, expired_at = self.clock.now(), ms_to_moment(record.expires_ms)
        if now <= expired_at:
            return
        ack_due_at = now - self._margin(wall_s=_ACK_ON_ITS_WAY_S)
        sent_at = expired_at - work.courier.lifetime
        has_listened = self.listening.covers(sent_at, ack_due_at)
        detail = f"the drone did not answer until {expired_at.isoformat()}"
        if says_not_flown(record, link) or silence_proves_not_flown(
            record, link, ack_due_at=ack_due_at, has_listened=has_listened
        ):
            await refuse(work, record, code="NO_ANSWER", detail=detail)
        elif now > expired_at + self._margin(fleet_s=300, wall_s=30):
            await put_in_doubt(work, record, code="NO_ANSWER", detail=detail)

    def _margin(self, *, wall_s: float, fleet_s: float = 0) -> timedelta:
        return fleet_margin(self.clock, fleet_s=fleet_s, wall_s=wall_s)
