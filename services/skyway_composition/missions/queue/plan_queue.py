"""What becomes of a drone's QUEUED missions: what to do about the next one, and their new plans.

They are planned one after the other, from where the drone is free.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import timedelta
from itertools import zip_longest
from typing import Final

from skyway.delivery.lateness import later_by_s
from skyway.delivery.plan import Plan
from skyway.errors import InvalidProblem
from skyway.ids import PackageId
from skyway.planner.problem import Problem
from skyway.planner.problem_parts import PackageToDeliver
from skyway.scheduling.standby import StandbyChoice, fitted, standby_for
from skyway.scheduling.stays import Slot, first_slot, slot_after, stay_to_begin_at
from skyway.scheduling.trip import NoTrip, Trip
from skyway.units import moment_to_ms
from skyway_composition.context import Context
from skyway_composition.links.link import DroneLink
from skyway_composition.margins import HAND_OVER
from skyway_composition.missions.mission.from_trip import replanned_in_queue
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.standby import WORTH_MS
from skyway_composition.networks.store import Present
from skyway_composition.planning.find_trip import round_trip
from skyway_composition.planning.problem_for import Standing, delivery_problem
from skyway_composition.planning.world import World


@dataclass(frozen=True, slots=True)
class Leave:
    """Do nothing now: the mission fits, or what it depends on is not known yet."""


@dataclass(frozen=True, slots=True)
class Shorten:
    """End the standby of the mission before at `until_ms`, so that the next one can begin."""

    until_ms: int


@dataclass(frozen=True, slots=True)
class Send:
    """The drone stands where the mission begins: send it."""


@dataclass(frozen=True, slots=True)
class PlanAgain:
    """The mission no longer fits: plan the drone's QUEUED missions again from this slot on."""

    slot: Slot


@dataclass(frozen=True, slots=True)
class GiveUp:
    """The drone cannot begin the mission, so another drone must be found."""

    detail: str


Decision = Leave | Shorten | Send | PlanAgain | GiveUp


@dataclass(frozen=True, slots=True)
class Times:
    """The present moment and spans of fleet time, in milliseconds.

    `reach_ms`: until an instruction reaches the drone. `plan_ms`: the same, with the time to plan
    first. `hand_over_ms`: between two missions. `send_ahead_ms`: how long before its start an idle
    drone gets a mission; `send_waiting_ms`: the same, if the mission waits for deliveries that
    share its trip. `longest_wait_ms`: how long after its planned start a mission waits for
    its drone.
    """

    now_ms: int
    reach_ms: int
    plan_ms: int
    hand_over_ms: int
    send_ahead_ms: int
    send_waiting_ms: int
    longest_wait_ms: int

    def is_soon(self, following: MissionRecord) -> bool:
        """Whether a mission begins so soon that an idle drone gets it now."""
        waits = following.request.qos.pooling_wait_s > 0
        ahead_ms = self.send_waiting_ms if waits else self.send_ahead_ms
        return following.start.at_ms <= self.now_ms + ahead_ms

    def is_overdue(self, following: MissionRecord) -> bool:
        """Whether a mission has waited too long for its drone."""
        return self.now_ms > following.start.at_ms + self.longest_wait_ms


def decide(
    following: MissionRecord,
    *,
    before: MissionRecord | None,
    link: DroneLink | None,
    is_planned_in_this_world: bool,
    times: Times,
) -> Decision:
    """What to do about the drone's next mission; `before` is its live mission, if it has one."""
    if before is not None:
        found = _after(following, before, is_in_this_world=is_planned_in_this_world, times=times)
    else:
        found = _when_free(following, link, is_in_this_world=is_planned_in_this_world, times=times)
    if isinstance(found, Leave) and times.is_overdue(following):
        return GiveUp("the drone is not free for its next mission")
    return found


def _after(
    following: MissionRecord, before: MissionRecord, *, is_in_this_world: bool, times: Times
) -> Decision:
    stays = before.stays
    if before.mission.state == "BOOKED" or before.proposal is not None or not stays:
        return Leave()
    reached_ms = times.now_ms + times.reach_ms
    start = following.start
    planned = Slot(start.station_id, start.at_ms - times.hand_over_ms, start.soc)
    stay = stay_to_begin_at(stays, planned, not_left_before_ms=reached_ms)
    if stay is None or not is_in_this_world:
        slot = first_slot(stays, not_before_ms=reached_ms)
        if slot is None:
            return Leave()
        return PlanAgain(Slot(slot.station_id, slot.at_ms + times.hand_over_ms, slot.soc))
    if stay.until_ms is None:
        return Leave()
    until_ms = max(stay.from_ms, min(stay.until_ms, planned.at_ms))
    return Shorten(until_ms)


def _when_free(
    following: MissionRecord, link: DroneLink | None, *, is_in_this_world: bool, times: Times
) -> Decision:
    state = None if link is None else link.state
    if link is None or state is None or link.has_unread_events:
        return Leave()
    if state.activity == "DOWN":
        return GiveUp("its drone has landed away from every station")
    if link.is_occupied or state.station_id is None:
        return Leave()
    here = Slot(state.station_id, times.now_ms + times.plan_ms, state.soc)
    start = following.start
    is_in_time = times.now_ms + times.reach_ms <= start.at_ms
    can_be_sooner = max(here.at_ms, following.earliest_ms) + WORTH_MS < start.at_ms
    if not is_in_this_world or not is_in_time or can_be_sooner or not here.allows(start):
        return PlanAgain(here)
    return Send() if times.is_soon(following) else Leave()


#: A mission may begin this much later than its drone is free and keep its plan, fleet milliseconds.
_MOST_SLACK_MS: Final = 60_000


@dataclass(frozen=True, slots=True)
class Moved:
    """A QUEUED mission with a new plan; its standby may end at `until_ms` for the next mission."""

    record: MissionRecord
    trip: Trip
    until_ms: int | None = None


@dataclass(frozen=True, slots=True)
class Dropped:
    """A QUEUED mission for which its drone has no plan any more."""

    record: MissionRecord
    reason: NoTrip


@dataclass(frozen=True, slots=True)
class QueuePlanner:
    """Plans QUEUED missions again, in a world in which their pads count as free.

    No package comes later than its promise by more than `tolerance_s` if another order of a
    mission's stops, or other recharges, can avoid it.
    """

    context: Context
    world: World
    tolerance_s: float

    async def plan(self, queued: Sequence[MissionRecord], slot: Slot) -> list[Moved | Dropped]:
        """New plans for the missions that no longer fit, in order; all later ones keep theirs.

        Nothing changes while a mission has no plan for a temporary reason: it is tried again.
        """
        changed: list[Moved | Dropped] = []
        present = self.world.present
        for record, later in zip_longest(queued, queued[1:]):
            if changed and _keeps_its_plan(record, slot, present):
                _end_last_standby(changed, record.start.at_ms - self._hand_over_ms)
                break
            fitting = None
            try:
                if later is not None and later.planned_in == present:
                    fitting = await self._trip_before(record, slot, later)
                trip = fitting or await self._trip(record, slot)
            except InvalidProblem as error:
                # A newer version of the network has hand-overs that are longer than the window.
                trip = NoTrip("WINDOW_MISSED", str(error), is_temporary=False)
            if isinstance(trip, NoTrip) and trip.is_temporary:
                return []
            if isinstance(trip, NoTrip):
                changed.append(Dropped(record, trip))
                continue
            _end_last_standby(changed, trip.start_ms - self._hand_over_ms)
            moved = replanned_in_queue(record, trip, slot, world=self.world)
            changed.append(Moved(moved, trip))
            if fitting is not None:
                break
            # Until then the drone may have left the station of its last delivery.
            free_ms = 0 if later is None else later.earliest_ms
            following = slot_after(
                moved.stays, not_before_ms=free_ms, hand_over_ms=self._hand_over_ms
            )
            slot = following or slot
        return changed

    @property
    def _hand_over_ms(self) -> int:
        return HAND_OVER.ms(self.context.clock)

    async def _trip_before(
        self, record: MissionRecord, slot: Slot, later: MissionRecord
    ) -> Trip | None:
        """A trip that ends where and when the next mission begins, which then keeps its plan."""
        start = later.start
        ready = Slot(start.station_id, start.at_ms - self._hand_over_ms, start.soc)
        if ready.at_ms <= max(slot.at_ms, record.earliest_ms):
            return None
        due_ms = deadline_ms(record)
        by_ms = ready.at_ms if due_ms is None else min(due_ms, ready.at_ms)
        trip = await self._trip_in_time(record, slot, standby=standby_for(ready), latest_ms=by_ms)
        return None if isinstance(trip, NoTrip) else fitted(trip, soc=slot.soc, ready=ready)

    async def _trip(self, record: MissionRecord, slot: Slot) -> Trip | NoTrip:
        by_ms, standby = deadline_ms(record), StandbyChoice.of(record.candidate)
        trip = await self._trip_in_time(record, slot, standby=standby, latest_ms=by_ms)
        if isinstance(trip, NoTrip) and record.request.has_windows:
            # The trip may need to begin sooner than before to meet its windows.
            world, from_ms = self._world_of(record), record.allowed_from_ms
            sooner = problem_of(world, record, slot, from_ms=from_ms, latest_ms=by_ms)
            trip = await round_trip(self.context.solver, world, sooner, standby=standby)
        return trip

    async def _trip_in_time(
        self, record: MissionRecord, slot: Slot, *, standby: StandbyChoice, latest_ms: int | None
    ) -> Trip | NoTrip:
        """The earliest trip that keeps the promises of several packages; without one any trip."""
        solver, world, tolerance_s = self.context.solver, self._world_of(record), self.tolerance_s
        problem = problem_of(world, record, slot, from_ms=record.earliest_ms, latest_ms=latest_ms)
        trip = await round_trip(solver, world, problem, standby=standby)
        if isinstance(trip, NoTrip):
            return trip
        start_ms = trip.start_ms
        due = with_promises(problem, trip.plan, record, start_ms=start_ms, tolerance_s=tolerance_s)
        kept = trip if due is None else await round_trip(solver, world, due, standby=standby)
        return trip if isinstance(kept, NoTrip) else kept

    def _world_of(self, record: MissionRecord) -> World:
        return self.world.for_drone(record.candidate.learned)


def _keeps_its_plan(record: MissionRecord, slot: Slot, present: Present) -> bool:
    start = record.start
    latest_ms = max(slot.at_ms, record.earliest_ms) + _MOST_SLACK_MS
    is_in_time = slot.at_ms <= start.at_ms <= latest_ms
    return is_in_time and slot.allows(start) and record.planned_in == present


def _end_last_standby(changed: list[Moved | Dropped], until_ms: int) -> None:
    """End the standby of the last mission with a new plan when the next mission begins."""
    for index in reversed(range(len(changed))):
        last = changed[index]
        if isinstance(last, Moved):
            changed[index] = replace(last, until_ms=until_ms)
            return


def with_promises(
    problem: Problem, plan: Plan, record: MissionRecord, *, start_ms: int, tolerance_s: float
) -> Problem | None:
    """The problem with promises as latest hand-overs; None if the plan keeps them.

    Also None with one package, which every plan delivers as early as it can. Two plans with the
    same end may differ in the order of the stops, or in where they recharge.
    """
    promised = {each.package_id for each in record.promised}
    by_ms = latest_ms(record, tolerance_s=tolerance_s)
    latest_s = {each: (by_ms[each] - start_ms) / 1000 for each in by_ms.keys() & promised}
    if len(problem.packages) == 1 or all(
        each.delivered_s <= latest_s.get(each.package_id, math.inf) for each in plan.deliveries
    ):
        return None
    packages = tuple(_due(each, latest_s.get(each.package_id)) for each in problem.packages)
    return problem.model_copy(update={"packages": packages})


def _due(package: PackageToDeliver, latest_s: float | None) -> PackageToDeliver:
    """The package with this latest hand-over, if it has no earlier one."""
    limits = [each for each in (package.latest_s, latest_s) if each is not None]
    return package.model_copy(update={"latest_s": min(limits, default=None)})


def deadline_ms(record: MissionRecord) -> int | None:
    """When the last delivery must be over, fleet milliseconds; None without a deadline."""
    deadline_at = record.request.qos.deadline_at
    return None if deadline_at is None else moment_to_ms(deadline_at)


def problem_of(
    world: World, record: MissionRecord, slot: Slot, *, from_ms: int, latest_ms: int | None
) -> Problem:
    """The problem of a QUEUED mission that begins at a slot, but not before `from_ms`."""
    return delivery_problem(
        world,
        Standing(record.candidate.planned_model, slot.soc, slot.station_id),
        request=record.request,
        start_ms=max(slot.at_ms, from_ms),
        latest_ms=latest_ms,
    )


def has_promise_to_make(record: MissionRecord, *, now_ms: int) -> bool:
    """Whether the mission's provisional promise has to become firm by this moment."""
    firm_at = record.mission.firm_at
    return firm_at is not None and moment_to_ms(firm_at) <= now_ms


def latest_ms(record: MissionRecord, *, tolerance_s: float) -> dict[PackageId, int]:
    """The latest delivery of each package that another order may have, if there is one.

    While the promise is provisional, only a deadline is a limit. Then it is the promise with the
    tolerance, or the present plan if that is later. On a mission that is not shared, a window or
    what the customer allows makes it later, but leaves the time that the wind may need.
    """
    promised, planned = record.promises, etas_ms(record)
    mission, by_ms = record.mission, deadline_ms(record)
    if mission.firm_at is not None:
        return {} if by_ms is None else {each: max(by_ms, at_ms) for each, at_ms in planned.items()}

    def latest(package_id: PackageId, planned_ms: int) -> int:
        at = promised[package_id].eta_at
        by = [moment_to_ms(at) + round(tolerance_s * 1000), planned_ms]
        if not record.shares:
            planned_s = (at - mission.start_at).total_seconds()
            wind = timedelta(seconds=later_by_s(planned_s, mission.margins.late_share or 0.0))
            by.append(moment_to_ms(record.request.kept_until(package_id, at + wind) - wind))
        return max(by)

    return {each: latest(each, at_ms) for each, at_ms in planned.items()}


def etas_ms(record: MissionRecord) -> dict[PackageId, int]:
    """When each package arrives by the present plan."""
    return {each.package_id: moment_to_ms(each.eta_at) for each in record.mission.packages}
