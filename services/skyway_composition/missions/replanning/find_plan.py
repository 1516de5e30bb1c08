"""Finds what becomes of a mission that needs another plan; nothing is changed.

The new plan begins at the anchor: where the drone stands, or the first place where its plan can be
changed. `Replanner` carries the outcome out. A dry run only shows it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

from skyway.contracts.flight_step import PickUpStep
from skyway.contracts.instruction import RefusalCode
from skyway.ids import ClosureId, StationId
from skyway.runtime.clock import FleetClock
from skyway.scheduling.stays import Slot
from skyway.scheduling.trip import NoTrip
from skyway.units import moment_to_ms
from skyway_composition.calendar.commit import Snapshot
from skyway_composition.closures.closure import Closure
from skyway_composition.context import Context
from skyway_composition.margins import HAND_OVER, REACHES_SURELY
from skyway_composition.missions.mission.record import MissionRecord, Trouble
from skyway_composition.missions.replanning.felt_wind import felt_margin
from skyway_composition.missions.replanning.remainder.anchor import (
    Anchor,
    anchor_of_stuck,
    find_anchor,
)
from skyway_composition.missions.replanning.remainder.planner import Remainder, RemainderPlanner
from skyway_composition.missions.replanning.situation import PlanningSituation, Situation
from skyway_composition.planning.problem_for import planned_more, with_margin
from skyway_composition.planning.world import ClosedAhead, World

#: If a drone had too little energy for its plan, the next plan has so much more margin.
_MORE_AFTER_REFUSAL: Final = 0.05


@dataclass(frozen=True, slots=True)
class Case:
    """All that a new plan is made from at a moment; it is checked again before the plan is sent.

    `felt_margin` is the energy margin that the plan needs in the wind that the drone feels.
    """

    situation: PlanningSituation
    trouble: Trouble
    world: World
    closed: ClosedAhead
    at_ms: int
    felt_margin: float = 0.0

    @property
    def energy_margin(self) -> float:
        """The share of energy that the plan adds to what the drone's planned model says."""
        margin = self.situation.energy_margin(self.world, at_ms=self.at_ms)
        return max(margin, self.felt_margin)

    @property
    def margin_after_refusal(self) -> float:
        """The margin of the next plan if the drone had too little energy for the last one, else 0.

        The drone may use more than it has reported. So each time a little is added.
        """
        stuck = self.record.stuck
        if stuck is None or stuck.code != RefusalCode.INSUFFICIENT_ENERGY:
            return 0.0
        return round(self.record.mission.margins.energy_margin + _MORE_AFTER_REFUSAL, 2)

    @property
    def record(self) -> MissionRecord:
        """The mission as it was read."""
        return self.situation.record

    @property
    def waits_for_operator(self) -> bool:
        """Whether the drone is held without a station to which it is diverted."""
        return self.record.mission.is_held and self.trouble.land_at is None

    def landing_at(self, station_id: StationId) -> "Case":
        """The same case with the drone diverted to this station, to wait there."""
        trouble = self.trouble.model_copy(update={"land_at": station_id})
        return replace(self, trouble=trouble)

    def anchor(
        self, *, closed: ClosedAhead, clock: FleetClock, before_step: int | None = None
    ) -> Anchor | None:
        """The place and moment from which the plan can be changed; see `find_anchor`."""
        earliest_ms = 1 + moment_to_ms(clock.now() + REACHES_SURELY.span(clock))
        stuck = self.record.stuck
        if stuck is not None:
            anchor = anchor_of_stuck(self.situation, stuck, earliest_ms=earliest_ms)
            return anchor if before_step is None else None
        # The flight under way has the weather of the present plan.
        margin = max(self.energy_margin, planned_more(self.situation.consumption_factor))
        return find_anchor(
            self.situation,
            self.trouble,
            model=with_margin(self.situation.model, margin),
            closed=closed,
            now_ms=moment_to_ms(clock.now()),
            earliest_ms=earliest_ms,
            before_step=before_step,
        )

    def ground_stop(self, anchor: Anchor) -> str | None:
        """Why the drone may not take off at the anchor; None when it may, or flies over it."""
        if anchor.is_in_the_air:
            return None
        standing = self.record.candidate.model_copy(update={"station_id": anchor.station_id})
        return self.world.conditions.ground_stop(standing, at_ms=anchor.at_ms)

    @property
    def seen(self) -> Snapshot:
        """What the plan depends on: also the step at which the drone was."""
        link = self.situation.link
        return Snapshot(
            self.world.present,
            {link.drone_id: link.calendar_version},
            {link.drone_id: link.at_step},
        )


def trouble_of(record: MissionRecord) -> Trouble | None:
    """Why a mission needs another plan; a stuck drone comes before any other trouble."""
    if record.stuck is None:
        return record.trouble
    land_at = None if record.trouble is None else record.trouble.land_at
    return Trouble(code=record.stuck.code, detail=record.stuck.detail, land_at=land_at)


def may_be_planned(situation: Situation, trouble: Trouble) -> bool:
    """Whether a plan can be made now; see `planning_obstacle`."""
    return planning_obstacle(situation, trouble) is None


def planning_obstacle(situation: Situation, trouble: Trouble) -> str | None:
    """The code of why no plan can be made now; None when one can be made.

    A drone that has not answered yet gets no new plan. A mission in doubt gets none either. A drone
    that is led elsewhere by a failsafe would refuse new steps, unless they override the failsafe. A
    held drone gets a plan only if it is diverted, or in flight: its next landing may be closed.
    """
    record = situation.record
    mission, state = record.mission, situation.link.state
    is_flying = state is not None and (state.mission_id, state.activity) == (
        record.mission_id,
        "FLYING",
    )
    if mission.doubt is not None:
        return "IN_DOUBT"
    if mission.state == "BOOKED" or record.proposal is not None:
        return "NOT_ANSWERED"
    if situation.steering_failsafe is not None and not trouble.overrides_failsafe:
        return "FAILSAFE_ACTIVE"
    return "HELD" if mission.is_held and trouble.land_at is None and not is_flying else None


def outage_of(record: MissionRecord, *, now_ms: int) -> Closure | None:
    """The outage, not made yet, of the pad that this mission's drone found occupied."""
    occupied = None if record.stuck is None else record.stuck.occupied
    if occupied is None or occupied.until_ms <= now_ms:
        return None
    return Closure(
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
        self, situation: PlanningSituation, *, supposed: Sequence[Closure] = ()
    ) -> Found:
        """What becomes of this mission.

        The `supposed` closures were not made: a dry run plans as if they were.
        """
        record, trouble = situation.record, trouble_of(situation.record)
        if trouble is None:
            return NoPlanYet("NO_PLAN_NEEDED")
        if (obstacle := planning_obstacle(situation, trouble)) is not None:
            return NoPlanYet(obstacle)
        if situation.sent_revisions >= MOST_REVISIONS:
            return NoMorePlans(trouble)
        # The pads of this drone's missions count as free.
        world = await World.of(
            await self.context.networks.current(record.network_id),
            self.context.db,
            after_ms=self.context.now_ms,
            supposed=supposed,
        )
        world = world.without([record.mission_id, *situation.queued.ids])
        world = world.for_drone(record.candidate.learned)
        # Reads the weather of the model here, since this may take a while.
        await world.weather(situation.model, self.context.now_ms)
        closed = ClosedAhead.of(world, now_ms=self.context.now_ms).for_model(situation.model)
        case = Case(situation, trouble, world, closed, self.context.now_ms)
        anchor = self._anchor(case, closed=closed)
        if anchor is None:
            return NoPlanYet("START_UNKNOWN")
        ready = situation.queued.start
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
