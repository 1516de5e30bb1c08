"""Find a drone's whole trip: the delivery in its windows, and the standby with the way there."""

from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Final

import numpy as np
import numpy.typing as npt

from skyway.contracts.candidate import Candidate
from skyway.contracts.message import utc_text
from skyway.delivery.plan import Deliver, PickUp, Plan, Wait
from skyway.delivery.request import DeliveryRequest
from skyway.errors import InvalidProblem
from skyway.ids import DroneId, StationId
from skyway.planner.problem import DroneAtStart, Problem
from skyway.scheduling.standby import (
    StandbyChoice,
    fitted,
    home_start_ms,
    search_standby,
    standby_for,
    trip_by_way_home,
)
from skyway.scheduling.stays import Slot
from skyway.scheduling.trip import BookedPad, NoTrip, Trip, no_plan, soc_after
from skyway.units import moment_to_ms
from skyway_composition.planning.availability import Opening
from skyway_composition.planning.problem_for import (
    Standing,
    delivery_problem,
    standby_problem,
    with_margins,
)
from skyway_composition.planning.solver_pool import SolverPool
from skyway_composition.planning.world import World

#: A drone is planned to stand ready this long before a window opens, fleet seconds: a small delay
#: on its way then costs nothing. Our own choice.
_READY_BEFORE_S: Final = 300.0

#: A trip is not planned again to begin later by less than this, fleet seconds. Our own choice.
_WORTH_S: Final = 60.0

#: A trip that begins later may end this much later, milliseconds: its floats add up differently.
_SAME_MS: Final = 2


async def begun_later(trip: Trip, begun_at: Callable[[int], Awaitable[Trip | NoTrip]]) -> Trip:
    """The trip that begins as late as its first window allows, if its last delivery is as early.

    Until then the drone is free for other missions. `begun_at` plans the same trip from another
    moment on.
    """
    slack_s = _first_wait_s(trip.plan) - _READY_BEFORE_S
    if slack_s < _WORTH_S:
        return trip
    later = await begun_at(trip.start_ms + round(slack_s * 1000))
    if isinstance(later, Trip) and later.home_start_ms <= trip.home_start_ms + _SAME_MS:
        return later
    return trip


def _first_wait_s(plan: Plan) -> float:
    """How long the drone waits, right before it loads or hands over for the first time it waits."""
    for step, following in pairwise(plan.steps):
        if isinstance(step, Wait) and isinstance(following, PickUp | Deliver):
            return step.end_s - step.start_s
    return 0.0


def missed_in_words(reason: NoTrip, request: DeliveryRequest) -> str:
    """Which window cannot be met, as a moment, and by how much it is missed."""
    late_s = dict(reason.data).get("late_s")
    by = "" if late_s is None else f" by {late_s:.0f} s"
    ends = [
        (each.latest_at, each.package_id)
        for each in request.packages
        if each.destination.station_id == reason.missed_at and each.latest_at is not None
    ]
    if ends:
        latest_at, package_id = min(ends)
        return (
            f"package {package_id!r} would miss its latest_at {utc_text(latest_at)} at "
            f"{reason.missed_at!r}{by}"
        )
    if reason.missed_at == request.pickup.station_id and request.latest_pickup_at is not None:
        return (
            f"loading at {reason.missed_at!r} would miss latest_pickup_at "
            f"{utc_text(request.latest_pickup_at)}{by}"
        )
    return f"the windows cannot be met: {reason.detail}"


def without_missed_window(problem: Problem, reason: NoTrip) -> Problem | None:
    """The problem without the end of the window that is missed; without all ends if unknown.

    A late package is better than none. None when no end of a window is the reason.
    """
    if reason.code not in ("WINDOW_MISSED", "NO_PAD_IN_TIME", "NO_PLAN_FOUND"):
        return None
    missed_at = reason.missed_at
    packages = tuple(
        each.model_copy(update={"latest_s": None})
        if missed_at in (None, each.destination)
        else each
        for each in problem.packages
    )
    is_pickup = missed_at in (None, problem.source)
    pickup_latest_s = None if is_pickup else problem.pickup_latest_s
    if packages == problem.packages and pickup_latest_s == problem.pickup_latest_s:
        return None
    return problem.model_copy(update={"packages": packages, "pickup_latest_s": pickup_latest_s})


async def round_trip(
    solver: SolverPool,
    world: World,
    problem: Problem,
    *,
    standby: StandbyChoice,
    held: Sequence[BookedPad] = (),
) -> Trip | NoTrip:
    """The problem's plan with the standby after its last delivery.

    `held` are pads that other drones will hold, as in `delivery_problem`.
    """
    plan = await solver.compose_in(world, problem)
    if not plan.is_flyable:
        return no_plan(plan)
    drone = Standing(
        model=problem.drone.model,
        soc=soc_after(plan, problem.drone.soc),
        station_id=_last_station(plan, problem.start_station_id),
    )
    start_ms = moment_to_ms(problem.start_at) if problem.start_at is not None else 0
    return await _with_standby(
        solver,
        world,
        plan,
        drone=drone,
        standby=standby,
        start_ms=start_ms,
        held=held,
    )


async def way_home(
    solver: SolverPool,
    world: World,
    plan: Plan,
    *,
    standing: Standing,
    standby: StandbyChoice,
    start_ms: int,
) -> Trip | NoTrip:
    """The trip of a drone that is `standing` at the end of `plan`, and its standby after that."""
    return await _with_standby(
        solver,
        world,
        plan,
        drone=with_margins(world, standing),
        standby=standby,
        start_ms=start_ms,
    )


async def _with_standby(
    solver: SolverPool,
    world: World,
    plan: Plan,
    *,
    drone: Standing,
    standby: StandbyChoice,
    start_ms: int,
    held: Sequence[BookedPad] = (),
) -> Trip | NoTrip:
    """The trip with the best end that the drone reaches, and where it charges if one has a pad."""
    at_end = DroneAtStart(model=drone.model, soc=drone.soc, station_id=drone.station_id)
    network, start = world.skyway.network, drone.station_id
    standby = await world.skyway.past_pickups.with_places(
        standby,
        network.fitting(drone.model.connector),
        start=start,
        at_ms=home_start_ms(plan, start_ms=start_ms),
    )
    search = search_standby(standby, network, start=start, drone=at_end)
    try:
        end = next(search)
        while True:
            end = search.send(
                await _with_way_to(
                    solver, world, plan, drone=drone, end=end, start_ms=start_ms, held=held
                )
            )
    except StopIteration as found:
        trip: Trip | NoTrip = found.value
        return trip


async def _with_way_to(
    solver: SolverPool,
    world: World,
    plan: Plan,
    *,
    drone: Standing,
    end: StationId,
    start_ms: int,
    held: Sequence[BookedPad],
) -> Trip | NoTrip:
    ended_ms = home_start_ms(plan, start_ms=start_ms)
    problem = standby_problem(world, drone, station_id=end, start_ms=ended_ms, held=held)
    home_plan = await solver.compose_in(world, problem)
    return trip_by_way_home(
        plan,
        problem,
        home_plan,
        start_ms=start_ms,
        booked=world.pads.book.seen_from(ended_ms),
        pad_gap_ms=round(world.skyway.settings.pad_gap_s * 1000),
    )


def _last_station(plan: Plan, start: StationId) -> StationId:
    places = [step.station_id for step in plan.steps if isinstance(step, Deliver)]
    return places[-1] if places else start


_TOO_SHORT: Final = NoTrip(
    "BUSY", "the drone would not be ready for its next mission in time", is_temporary=True
)


@dataclass(slots=True)
class TripFinder:
    """Finds trips in one world; each distinct trip is composed once.

    Trips begin at `start_ms`. A drone with an opening begins at its slot, and must be ready for the
    mission after it. The pads of the missions around an opening count as free: it is the same
    drone. The last delivery must be over by `latest_ms`; None means no limit.
    """

    solver: SolverPool
    world: World
    start_ms: int
    latest_ms: int | None
    openings: Mapping[DroneId, Opening] = field(default_factory=dict)
    _found: dict[object, Trip | NoTrip] = field(default_factory=dict)

    async def trip(
        self, candidate: Candidate, request: DeliveryRequest, *, held: Sequence[BookedPad] = ()
    ) -> Trip | NoTrip:
        """The trip of this candidate with the packages of a request; `held` pads are not free."""
        key = self.flies_like(candidate), request.packages, tuple(held)
        found = self._found.get(key)
        if found is None:
            found = self._found[key] = await self._composed(candidate, request, held)
        return found

    def flies_like(self, candidate: Candidate) -> object:
        """Equal for drones that have the same trips."""
        return (
            self.openings.get(candidate.drone_id),
            self.world.for_drone(candidate.learned).use_deviation,
            candidate.planned_model,
            candidate.station_id,
            candidate.soc,
            StandbyChoice.of(candidate),
        )

    def start_of(self, drone_id: DroneId) -> int:
        """The earliest start of this drone, fleet milliseconds."""
        opening = self.openings.get(drone_id)
        return self.start_ms if opening is None else opening.slot.at_ms

    def waits_s(self, drone_ids: Sequence[DroneId]) -> npt.NDArray[np.float64]:
        """How long each of these drones begins after `start_ms`; ``(n,)`` float64, seconds."""
        return np.array([(self.start_of(each) - self.start_ms) / 1000 for each in drone_ids])

    async def _composed(
        self,
        candidate: Candidate,
        request: DeliveryRequest,
        held: Sequence[BookedPad],
    ) -> Trip | NoTrip:
        latest_ms, start_ms = self.latest_ms, self.start_of(candidate.drone_id)
        is_ready_first = False  # whether the next mission comes before the deadline
        opening = self.openings.get(candidate.drone_id)
        world = self.world.for_drone(candidate.learned)
        standby = StandbyChoice.of(candidate)
        ready: Slot | None = None
        if opening is not None:
            world = world.without(opening.neighbours)
            if opening.before is not None:
                ready = opening.before.ready
                standby = standby_for(ready)
                is_ready_first = latest_ms is None or ready.at_ms < latest_ms
                latest_ms = ready.at_ms if is_ready_first else latest_ms
        if latest_ms is not None and latest_ms < start_ms:
            if is_ready_first:
                return _TOO_SHORT
            detail = "the deadline lies before the earliest start"
            return self._with_deadline(NoTrip("TOO_LATE", detail, is_temporary=False), start_ms)
        standing = Standing(candidate.planned_model, candidate.soc, candidate.station_id)

        async def begun_at(begins_ms: int) -> Trip | NoTrip:
            problem = delivery_problem(
                world,
                standing,
                request=request,
                start_ms=begins_ms,
                latest_ms=latest_ms,
                held=held,
            )
            return await round_trip(self.solver, world, problem, standby=standby, held=held)

        try:
            trip = await begun_at(start_ms)
        except InvalidProblem as error:
            return NoTrip("WINDOW_MISSED", str(error), is_temporary=False)
        if request.has_windows and opening is None and isinstance(trip, Trip):
            trip = await begun_later(trip, begun_at)
        if isinstance(trip, NoTrip) and trip.code == "WINDOW_MISSED":
            return replace(trip, detail=missed_in_words(trip, request))
        if ready is not None and isinstance(trip, Trip):
            return fitted(trip, soc=candidate.soc, ready=ready) or _TOO_SHORT
        if isinstance(trip, NoTrip) and trip.code in ("TOO_LATE", "NO_PAD_IN_TIME"):
            return _TOO_SHORT if is_ready_first else self._with_deadline(trip, start_ms)
        return trip

    def _with_deadline(self, reason: NoTrip, start_ms: int) -> NoTrip:
        if self.latest_ms is None:
            return reason
        return replace(reason, data=(("latest_s", (self.latest_ms - start_ms) / 1000),))
