"""Replanning: a mission whose plan no longer holds gets a new revision.

Either its drone stands and waits (a step failed, it refused a revision, it lost its journal), or it
flies by a plan that leads to trouble. `PlanFinder` finds the new plan. The transaction that sends
it, puts it off or gives up checks again what was planned with. After any change the mission is
planned again.
"""

import asyncio
import logging
from dataclasses import dataclass, replace
from typing import Final

from skyway.ids import DroneId
from skyway.runtime.errors import RowRefused
from skyway.runtime.sql.database import Tx
from skyway.scheduling.trip import NoTrip
from skyway.units import NEVER_MS, moment_to_ms
from skyway_composition.calendar.commit import WorldChanged
from skyway_composition.closures.close import Closings
from skyway_composition.closures.store import outages
from skyway_composition.context import Context
from skyway_composition.links.instruction_store import open_instructions
from skyway_composition.missions.mission.end import abort, cancel
from skyway_composition.missions.mission.instruct import hold
from skyway_composition.missions.mission.record import MissionRecord, Trouble
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork, raise_alarm
from skyway_composition.missions.replanning.call_off import (
    can_stay_at_pickup,
    request_call_off,
    surely_stays_at_pickup,
)
from skyway_composition.missions.replanning.case import Case, outage_of
from skyway_composition.missions.replanning.find_plan import (
    MOST_REVISIONS,
    Found,
    Grounded,
    NewPlan,
    NoDiversion,
    NoMorePlans,
    NoPlan,
    NoPlanYet,
    PlanFinder,
)
from skyway_composition.missions.replanning.propose import propose, replace_plan, revision_of
from skyway_composition.missions.replanning.remainder.anchor import Anchor
from skyway_composition.missions.replanning.remainder.planner import Remainder
from skyway_composition.missions.replanning.situation import read_situation
from skyway_composition.missions.replanning.store import claim_stuck, put_off, retry_stuck

log = logging.getLogger(__name__)


#: Wall time until planning is tried again when no plan was found. Our own choice.
_RETRY_MS: Final = 2_000


@dataclass(frozen=True, slots=True)
class Replanner:
    """Finds new plans for missions that need one."""

    context: Context
    claimant: str
    closings: Closings

    async def step(self) -> bool:
        """Plan for a few missions that need it; True when there may be more.

        The missions are planned one by one. After an error a mission is planned again when its
        claim is over.
        """
        drone_ids = await claim_stuck(self.context.db, self.context.clock, self.claimant)
        ends = await asyncio.gather(*map(self.replan, drone_ids), return_exceptions=True)
        failures = [each for each in ends if isinstance(each, Exception)]
        if failures:
            raise ExceptionGroup("missions not replanned", failures)
        return bool(drone_ids)

    async def replan(self, drone_id: DroneId) -> None:
        """Give this drone's mission a new revision; without a plan, try again later or give up."""
        seen = await read_situation(self.context, drone_id)
        if seen is not None and seen[0].needs_pad_closed:
            await self._close_pad(seen[0].record)
            # Closing a pad changes missions, this one included.
            seen = await read_situation(self.context, drone_id)
        if seen is None:
            return
        situation, sent_revisions, queued = seen
        finder = PlanFinder(self.context)
        found = await finder.find(situation, sent_revisions=sent_revisions, queued=queued)
        await self._apply(situation.record, found)

    async def _apply(self, record: MissionRecord, found: Found) -> None:
        match found:
            case NewPlan():
                await self._send_or_retry(found.case, found.anchor, found.remainder)
            case NoPlanYet():
                await self._retry_later(record)
            case Grounded():
                await self._hold(record, found.stop)
            case NoDiversion():
                await self._stop_diverting(found.case, found.reason)
            case NoMorePlans():
                await self._stop_trying(record, found.trouble)
            case NoPlan():
                await self._give_up(record, code=found.code, detail=found.detail)

    async def _close_pad(self, record: MissionRecord) -> None:
        """Close the pad that this mission's drone found occupied, unless it is closed already.

        This needs its own transaction: closures lock a network before any drone.
        """
        outage = outage_of(record, now_ms=self.closings.now_ms)
        if outage is None:
            return
        async with self.closings.db.read() as connection:
            closed = await outages(connection, at_ms=outage.from_ms, station_id=outage.station_id)
        if any(each.pad == outage.pad for each in closed):
            return
        await self.closings.make(outage)

    async def _send_or_retry(self, case: Case, anchor: Anchor, remainder: Remainder) -> None:
        """Send this remainder of the mission; if a pad is reserved by now, plan again later."""
        try:
            async with self.context.db.write() as tx:
                await self._send(tx, case, anchor, remainder)
        except RowRefused as taken:
            mission_id = case.record.mission_id
            log.info("pad taken", extra={"mission_id": mission_id, "by": taken.constraint})
            await self._retry_later(case.record)

    async def _send(self, tx: Tx, case: Case, anchor: Anchor, remainder: Remainder) -> None:
        """Send this remainder of the mission, unless the world or the mission has changed."""
        work = await self._lock_as_seen(case, tx)
        # After the links: every transaction locks links before missions.
        await retry_stuck(tx, case.record.mission_id, at_wall_ms=0)
        if work is None or remainder.trip.start_ms < self.context.now_ms:
            return
        record = work.missions[case.record.drone_id]
        revision = revision_of(
            record,
            remainder,
            anchor=anchor,
            trouble=case.trouble,
            number=case.sent_revisions + 1,
            energy_margin=case.energy_margin,
            world=case.world,
            link=work.links[record.drone_id],
        )
        if case.closed.closes_landing(anchor.station_id, anchor.at_ms) and remainder.given_up:
            await _raise_no_landing(work, record, anchor)
        if record.stuck is None:
            await propose(work, record, revision, anchor=anchor, trouble=case.trouble)
        else:
            await replace_plan(work, record, revision, trouble=case.trouble)

    async def _retry_later(self, record: MissionRecord) -> None:
        """Plan again a little later."""
        async with self.context.db.write() as tx:
            await put_off(tx, record.mission_id, until_wall_ms=self._retry_wall_ms)

    async def _hold(self, record: MissionRecord, stop: str) -> None:
        """Keep the drone on the ground while a ground stop lasts, and plan again later."""
        async with self.context.db.write() as tx:
            work = await self._lock(record.drone_id, tx)
            current = work.missions.get(record.drone_id)
            if current is not None and current.mission_id == record.mission_id:
                await _hold_for_stop(work, current, stop=stop)
        await self._retry_later(record)

    async def _stop_trying(self, record: MissionRecord, trouble: Trouble) -> None:
        """Make no more plans: a standing drone's mission ends, a flying drone flies on."""
        if record.stuck is not None:
            detail = f"{MOST_REVISIONS} revisions led nowhere; the last: {trouble.detail}"
            await self._give_up(record, code=trouble.code, detail=detail)
            return
        async with self.context.db.write() as tx:
            work = await self._lock(record.drone_id, tx)
            current = work.missions.get(record.drone_id)
            if current is not None and current.mission_id == record.mission_id:
                await stop_trying(work, current, trouble)
                # Until another plan is requested.
                await put_off(tx, record.mission_id, until_wall_ms=NEVER_MS)

    async def _stop_diverting(self, case: Case, reason: NoTrip) -> None:
        """Leave the drone held, because it cannot reach the station of its diversion."""
        async with self.context.db.write() as tx:
            work = await self._lock_as_seen(case, tx)
            if work is not None:
                record = work.missions[case.record.drone_id]
                await stop_diverting(work, record, reason=f"{reason.code}: {reason.detail}")
            await put_off(tx, case.record.mission_id, until_wall_ms=self._retry_wall_ms)

    async def _give_up(self, planned: MissionRecord, *, code: str, detail: str) -> None:
        """End a mission for which no plan was found, if the drone still has this mission."""
        async with self.context.db.write() as tx:
            work = await self._lock(planned.drone_id, tx)
            record = work.missions.get(planned.drone_id)
            if record is None or record.mission_id != planned.mission_id:
                return
            if not await _surely_stands(work, record):
                # It may begin before a CANCEL reaches it, or has begun: plan again later.
                await put_off(tx, record.mission_id, until_wall_ms=self._retry_wall_ms)
                return
            await give_up(work, record, code=code, detail=detail)

    async def _lock_as_seen(self, case: Case, tx: Tx) -> MissionUnitOfWork | None:
        """The locked drone of a case; None if anything has changed that its plan depends on."""
        try:
            return await MissionUnitOfWork.lock_as_seen(self.context, tx, case.seen)
        except WorldChanged:
            return None

    async def _lock(self, drone_id: DroneId, tx: Tx) -> MissionUnitOfWork:
        return await MissionUnitOfWork.lock(self.context, tx, [drone_id])

    @property
    def _retry_wall_ms(self) -> int:
        return moment_to_ms(self.context.clock.wall_now()) + _RETRY_MS


async def _surely_stands(work: MissionUnitOfWork, record: MissionRecord) -> bool:
    """Whether the drone waits for a revision, or a CANCEL is expected before it loads."""
    link = work.links[record.drone_id]
    if record.stuck is not None:
        return not link.has_unread_events
    steps = await work.steps.of(record.mission_id)
    return can_stay_at_pickup(record, steps, work.clock, link=link, needs_plan=False)


async def give_up(
    work: MissionUnitOfWork, record: MissionRecord, *, code: str, detail: str
) -> None:
    """End a mission whose drone stands; a drone that may begin to load must agree first."""
    if record.stuck is not None:
        await abort(work, record, at=work.clock.now(), code=code, detail=detail)
    elif surely_stays_at_pickup(record, link=work.links[record.drone_id]):
        await cancel(work, record, code=code, detail=detail)
    else:
        await request_call_off(work, record, code=code, detail=detail)


async def stop_trying(work: MissionUnitOfWork, record: MissionRecord, trouble: Trouble) -> None:
    """Let a drone that refuses every revision fly on by its plan, and raise an alarm.

    The trouble stays: otherwise the same trouble would be found and reported every second.
    """
    await raise_alarm(
        work,
        record,
        level="URGENT",
        code="REVISIONS_REFUSED",
        detail=f"no revision was accepted; the drone flies on in spite of {trouble.code}",
    )


async def stop_diverting(work: MissionUnitOfWork, record: MissionRecord, *, reason: str) -> None:
    """Leave a drone held where it stands or lands next, because it cannot be diverted.

    The trouble stays: what was closed before the diversion may still lie on the drone's way.
    """
    await raise_alarm(
        work,
        record,
        level="URGENT",
        code="DIVERSION_IMPOSSIBLE",
        detail=f"the drone is held where it stands or lands next; {reason}",
    )
    trouble = record.trouble
    if trouble is not None:
        await work.save(replace(record, trouble=trouble.model_copy(update={"land_at": None})))


async def _hold_for_stop(work: MissionUnitOfWork, record: MissionRecord, *, stop: str) -> None:
    """Keep a drone on the ground while a ground stop lasts; its next revision ends the hold."""
    state = work.links[record.drone_id].state
    if state is not None and state.is_held and state.mission_id == record.mission_id:
        return
    sent = await open_instructions(work.tx, record.drone_id)
    if any(each.kind == "HOLD" for each in sent):
        return
    await hold(work, record, reason=stop)


async def _raise_no_landing(work: MissionUnitOfWork, record: MissionRecord, anchor: Anchor) -> None:
    """Raise an alarm about a drone that lands at a closed station, the only one in reach."""
    await raise_alarm(
        work,
        record,
        level="CRITICAL",
        code="NO_SAFE_LANDING",
        detail=f"no open station is in reach; the drone lands at {anchor.station_id!r}",
        station_id=anchor.station_id,
        data={"soc": anchor.soc},
    )
