"""Find a drone's whole trip: the delivery, and its standby with the way there and a recharge."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from skyway.contracts.candidate import Candidate
from skyway.delivery.plan import Deliver, Plan
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
from skyway_composition.planning.windows import begun_later, missed_in_words
from skyway_composition.planning.world import World, compose_in


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
    plan = await compose_in(solver, world, problem)
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
    home_plan = await compose_in(solver, world, problem)
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
