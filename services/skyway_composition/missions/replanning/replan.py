"""Replanning: a mission whose plan no longer holds gets a new revision.

Either its drone stands and waits (a step failed, it refused a revision, it lost its journal), or it
flies by a plan that leads to trouble. `PlanFinder` finds the new plan. The transaction that sends
it checks again what was planned with. After any change the mission is planned again.
"""

import asyncio
from dataclasses import dataclass

from skyway.ids import DroneId
from skyway_composition.closures.close import Closings
from skyway_composition.closures.store import outages
from skyway_composition.context import Context
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.replanning.apply_outcome import Outcomes
from skyway_composition.missions.replanning.case import outage_of
from skyway_composition.missions.replanning.find_plan import (
    Found,
    Grounded,
    NewPlan,
    NoDiversion,
    NoMorePlans,
    NoPlan,
    NoPlanYet,
    PlanFinder,
)
from skyway_composition.missions.replanning.situation import read_situation
from skyway_composition.missions.replanning.store import claim_stuck


@dataclass(frozen=True, slots=True)
class OccupiedPads:
    """Closes occupied pads; missions that have reserved them get other plans."""

    closings: Closings

    async def close(self, record: MissionRecord) -> None:
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


@dataclass(frozen=True, slots=True)
class Replanner:
    """Finds new plans for missions that need one."""

    context: Context
    claimant: str
    occupied: OccupiedPads

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
            await self.occupied.close(seen[0].record)
            # Closing a pad changes missions, this one included.
            seen = await read_situation(self.context, drone_id)
        if seen is None:
            return
        situation, sent_revisions, queued = seen
        found = await self._finder.find(situation, sent_revisions=sent_revisions, queued=queued)
        await self._apply(situation.record, found)

    async def _apply(self, record: MissionRecord, found: Found) -> None:
        match found:
            case NewPlan():
                await self._outcomes.send_or_retry(found.case, found.anchor, found.remainder)
            case NoPlanYet():
                await self._outcomes.retry_later(record)
            case Grounded():
                await self._outcomes.hold(record, found.stop)
            case NoDiversion():
                await self._outcomes.stop_diverting(found.case, found.reason)
            case NoMorePlans():
                await self._outcomes.stop_trying(record, found.trouble)
            case NoPlan():
                await self._outcomes.give_up(record, code=found.code, detail=found.detail)

    @property
    def _finder(self) -> PlanFinder:
        return PlanFinder(self.context)

    @property
    def _outcomes(self) -> Outcomes:
        return Outcomes(self.context)
