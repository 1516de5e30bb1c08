"""Finds what a change would mean for missions, for dry runs.

The change is made in a transaction that is rolled back (`Database.rehearse`). The new plan is then
made as for the change itself, and is not sent.
"""

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from skyway.contracts.flight_step import FlyStep
from skyway.runtime.clock import FleetClock
from skyway.units import ms_to_moment
from skyway_composition.closures.closure import Closure, ForeseenPlan
from skyway_composition.context import Context
from skyway_composition.missions.mission.instruct import is_being_called_off
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork
from skyway_composition.missions.replanning.find_plan import (
    Found,
    Grounded,
    NewPlan,
    NoDiversion,
    NoMorePlans,
    NoPlan,
    NoPlanYet,
    PlanFinder,
    outage_of,
    trouble_of,
)
from skyway_composition.missions.replanning.outlook import (
    NOT_YET,
    MissionOutlook,
    PlannedLanding,
    Rehearsed,
    landing_of,
    packages_of,
)
from skyway_composition.missions.replanning.prediction import Load, predict
from skyway_composition.missions.replanning.propose import Revision, revision_of
from skyway_composition.missions.replanning.situation import (
    PlanningSituation,
    Situation,
    whereabouts,
)

#: Longest time to plan for a dry run, seconds of wall time. Our own choice.
LONGEST_S: Final = 10.0

#: A plan with its code and detail.
_PlanAndReason = tuple[ForeseenPlan, str | None, str | None]


async def rehearsed(work: MissionUnitOfWork, before: Situation) -> Rehearsed:
    """The mission after the change that this transaction has made, and `before` it."""
    record = before.record
    after = work.missions.get(record.drone_id)
    is_live = after is not None and after.mission_id == record.mission_id
    held = record.own(await work.custody.held_on(record))
    return Rehearsed(
        before=before,
        after=await PlanningSituation.of(work, after) if after is not None and is_live else None,
        held=held,
        is_called_off=await is_being_called_off(work, record.drone_id, record.mission_id),
    )


@dataclass(frozen=True, slots=True)
class Foresight:
    """Plans for rehearsed changes."""

    context: Context

    async def outlook(self, seen: Rehearsed, *, supposed: Sequence[Closure] = ()) -> MissionOutlook:
        """What the mission would do; the `supposed` closures count as made.

        It takes at most `LONGEST_S`.
        """
        found, is_late = None, False
        try:
            async with asyncio.timeout(LONGEST_S):
                found = await self._found(seen, supposed)
        except TimeoutError:
            is_late = True
        revision = None if seen.after is None else _revision(seen.after, found, self.context.clock)
        landing = self._landing(seen, found, revision)
        plan, code, detail = ("TIME_UP", None, None) if is_late else _plan_and_reason(seen, found)
        state = seen.before.link.state
        return MissionOutlook(
            plan=plan,
            code=code,
            detail=detail,
            ends_mission=seen.after is None or seen.is_called_off or isinstance(found, NoPlan),
            next_landing=landing,
            packages=tuple(packages_of(seen, found, revision=revision, landing=landing)),
            reported_at=None if state is None else state.at,
        )

    async def _found(self, seen: Rehearsed, supposed: Sequence[Closure]) -> Found | None:
        """The plan after the change; None when the change needs no plan."""
        after = seen.after
        if after is None or seen.is_called_off or trouble_of(after.record) is None:
            return None
        outage = outage_of(after.record, now_ms=self.context.now_ms)
        closures = supposed if outage is None else (*supposed, outage)
        found = await PlanFinder(self.context).find(after, supposed=closures)
        return await self._after_stop(found, supposed) if isinstance(found, Grounded) else found

    async def _after_stop(self, found: Grounded, supposed: Sequence[Closure]) -> Found:
        """The plan from the end of a supposed ground stop on, if the end is known."""
        ends = [each.until_ms for each in supposed if each.kind == "GROUND_STOP"]
        until_ms = max((each for each in ends if each is not None), default=0)
        later = replace(found.anchor, at_ms=max(found.anchor.at_ms, until_ms))
        if found.case.ground_stop(later) is not None:
            return found
        return await PlanFinder(self.context).find_from(later, found.case, found.ready)

    def _landing(
        self, seen: Rehearsed, found: Found | None, revision: Revision | None
    ) -> PlannedLanding | None:
        state = seen.before.link.state
        is_flying = state is not None and state.activity == "FLYING"
        if isinstance(found, NewPlan) and revision is not None:
            return landing_of(found, revision, is_flying=is_flying)
        return self._landing_by_present_plan(seen.before) if is_flying else None

    def _landing_by_present_plan(self, situation: Situation) -> PlannedLanding | None:
        """Where a drone in flight lands by the plan that it has."""
        where = whereabouts(situation)
        if where is None:
            return None
        steps = [each for each in situation.planned if each.step_id >= where.next_step]
        load = Load(situation.masses_kg, situation.carried)
        model = situation.model
        for each in predict(steps, where, model=model, load=load, now_ms=self.context.now_ms):
            if isinstance(each.step, FlyStep) and each.step.lands:
                return PlannedLanding(station_id=each.step.to_id, at=ms_to_moment(each.end_ms))
        return None


def _revision(after: Situation, found: Found | None, clock: FleetClock) -> Revision | None:
    """The revision that would be sent."""
    if not isinstance(found, NewPlan):
        return None
    return revision_of(found, after.record, after.link, clock=clock)


def _plan_and_reason(seen: Rehearsed, found: Found | None) -> _PlanAndReason:
    """What kind of plan was found, and why there is none."""
    match found:
        case None if seen.is_called_off:
            return "NOT_NEEDED", None, "the mission ends when its drone has agreed"
        case None:
            return "NOT_NEEDED", None, None
        case NewPlan() if found.remainder.given_up is not None:
            detail = "packages on board are left where the drone lands"
            return "NO_PLAN", found.remainder.given_up, detail
        case NewPlan():
            return "NEW_PLAN", None, None
        case NoPlanYet():
            return "NO_PLAN_YET", found.code, NOT_YET.get(found.code, "it is tried again")
        case Grounded():
            return "NO_PLAN_YET", "GROUND_STOP", found.stop
        case NoDiversion():
            return "NO_PLAN", found.reason.code, found.reason.detail
        case NoMorePlans():
            detail = "the mission has had too many plans; its drone flies on by the present one"
            return "NO_PLAN", "REVISIONS_REFUSED", detail
        case NoPlan():
            return "NO_PLAN", found.code, found.detail
