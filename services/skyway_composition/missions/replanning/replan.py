"""Replanning: a mission whose plan no longer holds gets a new revision.

Either its drone stands and waits (a step failed, it refused a revision, it lost its journal), or it
flies by a plan that leads to trouble. `PlanFinder` finds the new plan. The transaction that sends
it, puts it off or gives up checks again what was planned with. After any change the mission is
planned again.
"""

import asyncio
import logging
from dataclasses import dataclass, replace
from functools import partial
from typing import Final

from skyway.ids import DroneId
from skyway.runtime.errors import RowRefused
from skyway.runtime.sql.database import Tx
from skyway.units import NEVER_MS, moment_to_ms
from skyway_composition.calendar.attempts import Change, commit
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
    outage_of,
)
from skyway_composition.missions.replanning.propose import propose, replace_plan, revision_of
from skyway_composition.missions.replanning.remainder.anchor import Anchor
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
        if seen is not None and seen.needs_pad_closed:
            await self._close_pad(seen.record)
            # Closing a pad changes missions, this one included.
            seen = await read_situation(self.context, drone_id)
        if seen is None:
            return
        await self._apply(seen.record, await PlanFinder(self.context).find(seen))

    async def _apply(self, record: MissionRecord, found: Found) -> None:
        match found:
            case NewPlan():
                start_ms = found.remainder.trip.start_ms
                await self._commit(record, Change(start_ms, partial(self._send, plan=found)))
            case NoPlanYet():
                await self._retry_later(record)
            case Grounded():
                await self._hold(record, found.stop)
            case NoDiversion():
                write = partial(self._stop_diverting, found=found)
                await self._commit(record, Change(NEVER_MS, write))
            case NoMorePlans():
                await self._stop_trying(record, found.trouble)
            case NoPlan():
                await self._give_up(record, Trouble(code=found.code, detail=found.detail))

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

    async def _commit(self, record: MissionRecord, change: Change[None]) -> None:
        """Commit a change of this mission, or have it planned again.

        If a pad is reserved by now, it is planned a little later, otherwise immediately.
        """
        lost = await commit(self.context, change)
        if isinstance(lost, RowRefused):
            about = {"mission_id": record.mission_id, "by": lost.constraint}
            log.info("pad taken", extra=about)
            await self._retry_later(record)
        elif lost is not None:
            async with self.context.db.write() as tx:
                await retry_stuck(tx, record.mission_id, at_wall_ms=0)

    async def _send(self, tx: Tx, *, plan: NewPlan) -> None:
        """Send this remainder of the mission."""
        case, anchor = plan.case, plan.anchor
        work = await MissionUnitOfWork.lock_as_seen(self.context, tx, case.seen)
        record = work.missions[case.record.drone_id]
        await retry_stuck(tx, record.mission_id, at_wall_ms=0)
        revision = revision_of(plan, record, work.links[record.drone_id], clock=work.clock)
        is_closed = case.closed.closes_landing(anchor.station_id, anchor.at_ms)
        if is_closed and plan.remainder.given_up:
            await _raise_no_landing(work, record, anchor)
        if record.stuck is None:
            await propose(work, record, revision, anchor=anchor, trouble=case.trouble)
        else:
            await replace_plan(work, record, revision, trouble=case.trouble)

    async def _retry_later(self, record: MissionRecord) -> None:
        """Plan again a little later."""
        async with self.context.db.write() as tx:
            await put_off(tx, record.mission_id, until_wall_ms=self._retry_wall_ms)

    async def _stop_diverting(self, tx: Tx, *, found: NoDiversion) -> None:
        """Leave the drone held, because it cannot reach the station of its diversion."""
        work = await MissionUnitOfWork.lock_as_seen(self.context, tx, found.case.seen)
        record, reason = work.missions[found.case.record.drone_id], found.reason
        await stop_diverting(work, record, reason=f"{reason.code}: {reason.detail}")
        await put_off(tx, record.mission_id, until_wall_ms=self._retry_wall_ms)

    async def _hold(self, record: MissionRecord, stop: str) -> None:
        """Keep the drone on the ground while a ground stop lasts, and plan again later."""
        async with self.context.db.write() as tx:
            work, current = await self._lock(record, tx)
            if current is not None:
                await _hold_for_stop(work, current, stop=stop)
        await self._retry_later(record)

    async def _stop_trying(self, record: MissionRecord, trouble: Trouble) -> None:
        """Make no more plans: a standing drone's mission ends, a flying drone flies on."""
        if record.stuck is not None:
            detail = f"{MOST_REVISIONS} revisions led nowhere; the last: {trouble.detail}"
            await self._give_up(record, Trouble(code=trouble.code, detail=detail))
            return
        async with self.context.db.write() as tx:
            work, current = await self._lock(record, tx)
            if current is not None:
                await stop_trying(work, current, trouble)
                # Until another plan is requested.
                await put_off(tx, record.mission_id, until_wall_ms=NEVER_MS)

    async def _give_up(self, planned: MissionRecord, why: Trouble) -> None:
        """End a mission for which no plan was found, if the drone still has this mission."""
        async with self.context.db.write() as tx:
            work, record = await self._lock(planned, tx)
            if record is None:
                return
            if not await _surely_stands(work, record):
                # It may begin before a CANCEL reaches it, or has begun: plan again later.
                await put_off(tx, record.mission_id, until_wall_ms=self._retry_wall_ms)
                return
            await give_up(work, record, why)

    async def _lock(
        self, seen: MissionRecord, tx: Tx
    ) -> tuple[MissionUnitOfWork, MissionRecord | None]:
        """The drone, locked, and the mission as it is now; None if the drone has left it."""
        work = await MissionUnitOfWork.lock(self.context, tx, [seen.drone_id])
        record = work.missions.get(seen.drone_id)
        is_same = record is not None and record.mission_id == seen.mission_id
        return work, record if is_same else None

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


async def give_up(work: MissionUnitOfWork, record: MissionRecord, why: Trouble) -> None:
    """End a mission whose drone stands; a drone that may begin to load must agree first."""
    if record.stuck is not None:
        await abort(work, record, why, at=work.clock.now())
    elif surely_stays_at_pickup(record, link=work.links[record.drone_id]):
        await cancel(work, record, why)
    else:
        await request_call_off(work, record, why)


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
