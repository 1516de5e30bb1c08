"""Finds what becomes of a mission that needs another plan; nothing is changed.

The new plan begins at the anchor: where the drone stands, or the first place where its plan can be
changed. `Replanner` carries the outcome out. A dry run only shows it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

from skyway.contracts.flight_step import PickUpStep
from skyway.scheduling.stays import Slot
from skyway.scheduling.trip import NoTrip
from skyway_composition.closures.closure import Closure
from skyway_composition.context import Context
from skyway_composition.margins import HAND_OVER
from skyway_composition.missions.mission.record import Trouble
from skyway_composition.missions.replanning.case import Case, planning_obstacle, trouble_of
from skyway_composition.missions.replanning.felt_wind import felt_margin
from skyway_composition.missions.replanning.remainder.anchor import Anchor
from skyway_composition.missions.replanning.remainder.planner import Remainder, RemainderPlanner
from skyway_composition.missions.replanning.situation import NextMissions, Situation
from skyway_composition.planning.world import ClosedAhead, World

#: After this many revisions a mission gets no further plan. Our own choice.
MOST_REVISIONS: Final = 40

#: How often, at most, a plan is made again with a larger energy margin. Our own choice.
_MOST_MARGINS: Final = 3


@dataclass(frozen=True, slots=True)
class NewPlan:
    """The remainder of the mission from this anchor on, to be sent to its drone."""

    case: Case
    anchor: Anchor
    remainder: Remainder


@dataclass(frozen=True, slots=True)
class NoPlanYet:
    """No plan can be made now, for the reason of this code; planning is tried again later."""

    code: str


@dataclass(frozen=True, slots=True)
class Grounded:
    """A ground stop, in words, keeps the drone at the anchor."""

    case: Case
    anchor: Anchor
    ready: Slot | None
    stop: str


@dataclass(frozen=True, slots=True)
class NoDiversion:
    """The drone cannot get to the station to which an operator diverts it."""

    case: Case
    reason: NoTrip


@dataclass(frozen=True, slots=True)
class NoMorePlans:
    """The mission has had the most revisions that a mission may have."""

    trouble: Trouble


@dataclass(frozen=True, slots=True)
class NoPlan:
    """There is no plan, so the mission ends."""

    code: str
    detail: str


Found = NewPlan | NoPlanYet | Grounded | NoDiversion | NoMorePlans | NoPlan


@dataclass(frozen=True, slots=True)
class PlanFinder:
    """Finds new plans; `solver` is where they are composed."""

    context: Context

    async def find(
        self,
        situation: Situation,
        *,
        sent_revisions: int,
        queued: NextMissions,
        supposed: Sequence[Closure] = (),
    ) -> Found:
        """What becomes of this mission; `queued` are the drone's next missions.

        The `supposed` closures were not made: a dry run plans as if they were.
        """
        record, trouble = situation.record, trouble_of(situation.record)
        if trouble is None:
            return NoPlanYet("NO_PLAN_NEEDED")
        if (obstacle := planning_obstacle(situation, trouble)) is not None:
            return NoPlanYet(obstacle)
        if sent_revisions >= MOST_REVISIONS:
            return NoMorePlans(trouble)
        # The pads of this drone's missions count as free.
        world = await World.of(
            await self.context.networks.current(record.network_id),
            self.context.db,
            after_ms=self.context.now_ms,
            without=[record.mission_id, *queued.ids],
            supposed=supposed,
        )
        world = world.for_drone(record.candidate.learned)
        # Reads the weather of the model here, since this may take a while.
        await world.weather(situation.model, self.context.now_ms)
        closed = ClosedAhead.of(world, now_ms=self.context.now_ms).for_model(situation.model)
        case = Case(situation, trouble, world, closed, sent_revisions)
        anchor = self._anchor(case, closed=closed)
        if anchor is None:
            return NoPlanYet("START_UNKNOWN")
        ready = queued.start
        if ready is not None:
            ready = replace(ready, at_ms=ready.at_ms - HAND_OVER.ms(self.context.clock))
        if case.waits_for_operator:
            if not anchor.is_divert:
                return NoPlanYet("HELD")
            case = case.landing_at(anchor.station_id)
        elif (stop := case.ground_stop(anchor)) is not None:
            return Grounded(case, anchor, ready, stop)
        return await self.find_from(anchor, case, ready)

    async def find_from(self, landing: Anchor, case: Case, ready: Slot | None) -> Found:
        """What becomes of the mission from this anchor on.

        `ready` is where, when and with what charge the drone begins its next mission, if it has
        one.
        """
        planner = self._planner(case, ready)
        anchor, remainder = await self._rest(case, planner, landing=landing)
        if isinstance(remainder, Remainder):
            plan = NewPlan(case, anchor, remainder)
            return await self._with_felt_margin(plan, ready, landing=landing)
        if remainder.is_temporary:
            return NoPlanYet(remainder.code)
        return self._without_plan(case, anchor, planner, remainder)

    def _planner(self, case: Case, ready: Slot | None) -> RemainderPlanner:
        return RemainderPlanner(
            self.context.solver, case.world, case.situation, case.closed, case.energy_margin, ready
        )

    async def _with_felt_margin(
        self, plan: NewPlan, ready: Slot | None, *, landing: Anchor
    ) -> NewPlan:
        """The plan with the energy that its flights need in the wind that the drone feels.

        A larger margin may lead to another way, which may need another margin. If no plan has
        enough energy, the last one counts: the drone may refuse it, or charge longer on the way.
        """
        for _ in range(_MOST_MARGINS):
            case = plan.case
            network = case.world.skyway.network
            felt = felt_margin(
                case.situation.felt_wind,
                plan.remainder.trip,
                network,
                model=case.record.candidate.model,
                lasting_factor=case.situation.lasting_factor,
            )
            margin = max(felt, case.margin_after_refusal)
            if margin <= case.energy_margin or plan.remainder.given_up is not None:
                return plan
            case = replace(case, felt_margin=margin)
            anchor, remainder = await self._rest(case, self._planner(case, ready), landing=landing)
            if not isinstance(remainder, Remainder) or remainder.aims != plan.remainder.aims:
                return plan
            plan = NewPlan(case, anchor, remainder)
        return plan

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

    def _without_plan(
        self, case: Case, anchor: Anchor, planner: RemainderPlanner, reason: NoTrip
    ) -> Found:
        """No plan was found: the drone stays where it is, or lands where it flies to."""
        if anchor.is_in_the_air:
            # No open station is in reach: the drone lands at its next station, open or closed.
            landing = self._anchor(case, closed=ClosedAhead(case.world.skyway.network))
            if landing is None:
                return NoPlanYet("START_UNKNOWN")
            return NewPlan(case, landing, planner.leave_here(landing, code=reason.code))
        if case.trouble.land_at is not None:
            return NoDiversion(case, reason)
        if case.record.stuck is None and (anchor.carried or anchor.has_loaded):
            return NewPlan(case, anchor, planner.leave_here(anchor, code=reason.code))
        code = refusal_code(case.situation, case.trouble, code=reason.code)
        return NoPlan(code, reason.detail)

    def _anchor(
        self, case: Case, *, closed: ClosedAhead, before_step: int | None = None
    ) -> Anchor | None:
        return case.anchor(closed=closed, clock=self.context.clock, before_step=before_step)


def refusal_code(situation: Situation, trouble: Trouble, *, code: str) -> str:
    """Why no plan is flown: MASS_MISMATCH if the loaded masses differ, else the planner's code."""
    planned = {
        package.package_id: package.mass_kg
        for step in situation.planned
        if isinstance(step, PickUpStep)
        for package in step.packages
    }
    loaded = {each.package_id: each.mass_kg for each in trouble.loaded or ()}
    return "MASS_MISMATCH" if loaded and loaded != planned else code
