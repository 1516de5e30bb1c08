"""Asks a drone for another standby, so that another drone's service gets the pads that it needs.

It is a proposal (decision 0010): the pads are free when the drone has accepted. The service of the
mission stays as it is.
"""

import logging
from collections.abc import Collection
from dataclasses import dataclass
from functools import partial
from typing import Final

from skyway.contracts.flight_step import DeliverStep, PickUpStep, ReturnStep
from skyway.ids import MissionId
from skyway.runtime.sql.database import Tx
from skyway.scheduling.giving_way import YieldingStandby
from skyway.scheduling.trip import BookedPad, Trip
from skyway_composition.calendar.attempts import Change, commit
from skyway_composition.context import Context
from skyway_composition.missions.mission.record import GIVE_WAY, Trouble
from skyway_composition.missions.mission.standby import (
    standby_steps,
    trip_with_other_standby,
    with_standby_of,
)
from skyway_composition.missions.mission.step_store import StepRecord
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork
from skyway_composition.missions.replanning.find_plan import Case, NewPlan, may_be_planned
from skyway_composition.missions.replanning.propose import Revision, propose, revision_of
from skyway_composition.missions.replanning.remainder.anchor import Anchor
from skyway_composition.missions.replanning.remainder.planner import Remainder, RemainderPlanner
from skyway_composition.missions.replanning.situation import Situation, read_situation, whereabouts
from skyway_composition.planning.world import ClosedAhead, World

log = logging.getLogger(__name__)

#: A mission with this many revisions keeps its remaining revisions for dangers. Our own choice.
_MOST_REVISIONS: Final = 20

#: Stands for the mission of the offer that is being planned: its pads count as reserved.
_UNBOOKED_MISSION: Final = MissionId("")

_WHY: Final = Trouble(code=GIVE_WAY, detail="another drone's service needs a pad of the standby")


@dataclass(frozen=True, slots=True)
class _Asked:
    """Another standby, as a revision of the mission."""

    case: Case
    anchor: Anchor
    revision: Revision
    starts_ms: int


@dataclass(frozen=True, slots=True)
class StandbyRequests:
    """Asks drones to give way."""

    context: Context

    async def ask(self, standby: YieldingStandby, needed: Collection[BookedPad]) -> bool:
        """Propose another standby without the `needed` pads; False if there is none.

        The drone's service, its packages and its next mission come first: then it is not asked.
        """
        case = await self._case(standby, needed)
        if case is None:
            return False
        served = _last_of_service(case.situation)
        if served is not None and served.status == "PLANNED":
            asked = await self._before_standby(case, served.step.step_id)
        else:
            asked = await self._in_standby(case)
        if asked is None:
            return False
        lost = await commit(self.context, Change(asked.starts_ms, partial(self._send, asked=asked)))
        about = {"mission_id": standby.mission_id, "lost": lost and repr(lost)}
        log.info("standby asked to give way", extra=about)
        return lost is None

    async def _case(self, standby: YieldingStandby, needed: Collection[BookedPad]) -> Case | None:
        situation = await read_situation(self.context, standby.drone_id)
        if situation is None or situation.sent_revisions >= _MOST_REVISIONS:
            return None
        record, is_last = situation.record, not situation.queued.ids
        is_same = record.mission_id == standby.mission_id and is_last and record.stays
        if not is_same or not may_be_planned(situation, _WHY):
            return None
        skyway = await self.context.networks.current(record.network_id)
        world = await World.of(skyway, self.context.db, after_ms=self.context.now_ms)
        world = world.without([record.mission_id]).instead({_UNBOOKED_MISSION: needed})
        world = world.for_drone(record.candidate.learned)
        await world.weather(situation.model, self.context.now_ms)
        closed = ClosedAhead.of(world, now_ms=self.context.now_ms).for_model(situation.model)
        return Case(situation, _WHY, world, closed, self.context.now_ms)

    async def _before_standby(self, case: Case, served_step: int) -> _Asked | None:
        """Another standby for a drone that has not ended its service; the service stays."""
        situation, record = case.situation, case.record
        where = whereabouts(situation)
        if where is None or max(where.next_step, where.released_through) > served_step:
            return None
        trip = await trip_with_other_standby(
            self.context.solver,
            case.world,
            record,
            energy_margin=case.energy_margin,
        )
        if not isinstance(trip, Trip):
            return None
        served = record.stays[0]
        anchor = Anchor(
            station_id=served.station_id,
            at_ms=trip.home_start_ms,
            soc=served.soc_from,
            last_valid_step=served_step,
            carried=frozenset(),
            has_loaded=True,
        )
        mission = with_standby_of(record.mission, trip, revision=situation.sent_revisions + 1)
        steps = standby_steps(record, trip, case.world, first_step=anchor.first_step)
        return _Asked(case, anchor, Revision(mission, steps, record.aims), trip.home_start_ms)

    async def _in_standby(self, case: Case) -> _Asked | None:
        """Another standby for a drone that has ended its service, from its next landing on."""
        situation, record = case.situation, case.record
        anchor = case.anchor(closed=case.closed, clock=self.context.clock)
        if anchor is None or anchor.is_in_the_air or situation.carried:
            return None
        if case.ground_stop(anchor) is not None:
            return None
        planner = RemainderPlanner(
            self.context.solver, case.world, situation, case.closed, case.energy_margin
        )
        remainder = await planner.plan(anchor, _WHY)
        if not isinstance(remainder, Remainder) or remainder.given_up is not None:
            return None
        plan, clock = NewPlan(case, anchor, remainder), self.context.clock
        revision = revision_of(plan, record, situation.link, clock=clock)
        if not record.with_mission(revision.mission).stays:
            # Nothing could be booked behind the mission until it is over.
            return None
        return _Asked(case, anchor, revision, remainder.trip.start_ms)

    async def _send(self, tx: Tx, *, asked: _Asked) -> None:
        work = await MissionUnitOfWork.lock_as_seen(self.context, tx, asked.case.seen)
        record = work.missions[asked.case.record.drone_id]
        await propose(work, record, asked.revision, anchor=asked.anchor, trouble=_WHY)


def _last_of_service(situation: Situation) -> StepRecord | None:
    """The last step that loads or hands over a package; the standby begins after it."""
    service = [
        each
        for each in situation.steps
        if isinstance(each.step, PickUpStep | DeliverStep | ReturnStep)
    ]
    return service[-1] if service else None
