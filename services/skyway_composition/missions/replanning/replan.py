"""Replanning: a mission whose plan no longer holds gets a new revision.

Either its drone stands and waits (a step failed, it refused a revision, it lost its journal), or it
flies by a plan that leads to trouble. The new plan begins at the anchor: where the drone stands, or
the first place where its plan can be changed. The transaction that sends the revision checks again
what was planned with. After any change the mission is planned again.
"""

import asyncio
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from skyway.ids import ClosureId, DroneId
from skyway.runtime.clock import FleetClock
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Database
from skyway.scheduling.stays import Slot
from skyway.scheduling.trip import NoTrip
from skyway.units import moment_to_ms
from skyway_composition.closures.close import Closings
from skyway_composition.closures.closure import Closure
from skyway_composition.closures.store import outages
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.replanning.apply_outcome import (
    MOST_REVISIONS,
    Outcomes,
    refusal_code,
)
from skyway_composition.missions.replanning.case import Case, may_be_planned, trouble_of
from skyway_composition.missions.replanning.remainder.anchor import Anchor
from skyway_composition.missions.replanning.remainder.planner import Remainder, RemainderPlanner
from skyway_composition.missions.replanning.situation import Situation, read_situation
from skyway_composition.missions.replanning.store import claim_stuck
from skyway_composition.networks.prepared import PreparedNetworks
from skyway_composition.planning.availability import hand_over_time_ms
from skyway_composition.planning.solver_pool import SolverPool
from skyway_composition.planning.world import ClosedAhead, World


@dataclass(frozen=True, slots=True)
class OccupiedPads:
    """Closes occupied pads; missions that have reserved them get other plans."""

    closings: Closings

    async def close(self, record: MissionRecord) -> None:
        """Close the pad that this mission's drone found occupied, unless it is closed already.

        This needs its own transaction: closures lock a network before any drone.
        """
        occupied = None if record.stuck is None else record.stuck.occupied
        now_ms = self.closings.now_ms
        if occupied is None or occupied.until_ms <= now_ms:
            return
        async with self.closings.db.read() as connection:
            closed = await outages(connection, at_ms=now_ms, station_id=occupied.station_id)
        if any(each.pad == occupied.pad for each in closed):
            return
        await self.closings.make(
            Closure(
                closure_id=ClosureId(""),
                kind="PAD",
                network_id=record.network_id,
                station_id=occupied.station_id,
                pad=occupied.pad,
                reason=f"drone {record.drone_id} found it occupied",
                from_ms=now_ms,
                until_ms=occupied.until_ms,
                made_ms=now_ms,
            )
        )


@dataclass(frozen=True, slots=True)
class Replanner:
    """Finds new plans for missions that need one."""

    db: Database
    networks: PreparedNetworks
    solver: SolverPool
    clock: FleetClock
    mint: Mint
    claimant: str
    occupied: OccupiedPads

    async def step(self) -> bool:
        """Plan for a few missions that need it; True when there may be more.

        The missions are planned one by one. After an error a mission is planned again when its
        claim is over.
        """
        drone_ids = await claim_stuck(self.db, self.clock, self.claimant)
        ends = await asyncio.gather(*map(self.replan, drone_ids), return_exceptions=True)
        failures = [each for each in ends if isinstance(each, Exception)]
        if failures:
            raise ExceptionGroup("missions not replanned", failures)
        return bool(drone_ids)

    async def replan(self, drone_id: DroneId) -> None:
        """Give this drone's mission a new revision; without a plan, try again later or give up."""
        seen = await self._read_situation(drone_id)
        if seen is not None and seen[0].needs_pad_closed:
            await self.occupied.close(seen[0].record)
            # Closing a pad changes missions, this one included.
            seen = await self._read_situation(drone_id)
        if seen is None:
            return
        situation, sent_revisions, queued = seen
        record, trouble = situation.record, trouble_of(situation.record)
        if trouble is None or not may_be_planned(situation, trouble):
            await self._outcomes.retry_later(record)
            return
        if sent_revisions >= MOST_REVISIONS:
            await self._outcomes.stop_trying(record, trouble)
            return
        world = await self._world(record, queued)
        closed = ClosedAhead.of(world, now_ms=self._now_ms())
        ready = None if not queued else self._ready_for(queued[0])
        await self._plan(Case(situation, trouble, world, closed, sent_revisions), ready)

    async def _plan(self, case: Case, ready: Slot | None) -> None:
        anchor = self._anchor(case, closed=case.closed)
        if anchor is None:
            await self._outcomes.retry_later(case.record)
            return
        if case.waits_for_operator:
            if not anchor.is_divert:
                await self._outcomes.retry_later(case.record)
                return
            case = case.landing_at(anchor.station_id)
        elif (stop := case.ground_stop(anchor)) is not None:
            await self._outcomes.hold(case.record, stop)
            return
        planner = RemainderPlanner(self.solver, case.world, case.situation, case.closed, ready)
        anchor, remainder = await self._rest(case, planner, landing=anchor)
        if isinstance(remainder, Remainder):
            await self._outcomes.send_or_retry(case, anchor, remainder)
        elif remainder.is_temporary:
            await self._outcomes.retry_later(case.record)
        else:
            await self._handle_no_plan(case, anchor, planner, remainder)

    async def _rest(
        self, case: Case, planner: RemainderPlanner, *, landing: Anchor
    ) -> tuple[Anchor, Remainder | NoTrip]:
        """The remainder from the next landing, else from a station that the drone flies over."""
        found = await planner.plan(landing, case.trouble)
        if isinstance(found, Remainder):
            return landing, found
        for over in self._flown_over(case, landing):
            sooner = await planner.plan(over, case.trouble)
            if isinstance(sooner, Remainder):
                return over, sooner
        return landing, found

    def _flown_over(self, case: Case, landing: Anchor) -> Iterator[Anchor]:
        """The stations before the landing where the drone may turn, the latest first."""
        over: Anchor | None = landing
        while over is not None:
            over = self._anchor(case, closed=case.closed, before_step=over.last_valid_step)
            if over is not None and case.ground_stop(over) is None:
                yield over

    async def _handle_no_plan(
        self, case: Case, anchor: Anchor, planner: RemainderPlanner, reason: NoTrip
    ) -> None:
        """No plan was found: the drone stays where it is, or lands where it flies to."""
        if anchor.is_in_the_air:
            # No open station is in reach: it lands where it flies to, closed or not.
            landing = self._anchor(case, closed=ClosedAhead(case.world.skyway.network))
            if landing is None:
                await self._outcomes.retry_later(case.record)
                return
            remainder = planner.leave_here(landing, code=reason.code)
            await self._outcomes.send_or_retry(case, landing, remainder)
        elif case.trouble.land_at is not None:
            await self._outcomes.stop_diverting(case, reason)
        elif case.record.stuck is None and (anchor.carried or anchor.has_loaded):
            remainder = planner.leave_here(anchor, code=reason.code)
            await self._outcomes.send_or_retry(case, anchor, remainder)
        else:
            code = refusal_code(case.situation, case.trouble, code=reason.code)
            await self._outcomes.give_up(case.record, code=code, detail=reason.detail)

    async def _read_situation(
        self, drone_id: DroneId
    ) -> tuple[Situation, int, Sequence[MissionRecord]] | None:
        return await read_situation(self.db, drone_id, clock=self.clock, mint=self.mint)

    async def _world(self, record: MissionRecord, queued: Sequence[MissionRecord]) -> World:
        """The present world, in which the pads of this drone's missions count as free."""
        skyway = await self.networks.current(record.network_id)
        own = [record.mission_id, *(each.mission_id for each in queued)]
        return await World.of(skyway, self.db, after_ms=self._now_ms(), without=own)

    def _ready_for(self, following: MissionRecord) -> Slot:
        """Where, when and with what charge the drone must be ready for its next mission."""
        start = following.start
        return Slot(start.station_id, start.at_ms - hand_over_time_ms(self.clock), start.soc)

    def _anchor(
        self, case: Case, *, closed: ClosedAhead, before_step: int | None = None
    ) -> Anchor | None:
        return case.anchor(closed=closed, clock=self.clock, before_step=before_step)

    @property
    def _outcomes(self) -> Outcomes:
        return Outcomes(self.db, self.clock, self.mint)

    def _now_ms(self) -> int:
        return moment_to_ms(self.clock.now())
