"""Find a drone's whole trip: the delivery, and its standby with the way there and a recharge."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from skyway.contracts.candidate import Candidate, ProviderReasonCode
from skyway.delivery.plan import Deliver, Plan, PlanStatus, Recharge
from skyway.delivery.request import DeliveryRequest
from skyway.drone.charging import recharge_time_s
from skyway.ids import DroneId, StationId
from skyway.planner.pad_book import PadBook, booked_until_ms
from skyway.planner.pad_calendar import PadCalendar
from skyway.planner.problem import Problem
from skyway.units import CHARGE_TOLERANCE, moment_to_ms
from skyway_composition.pads.booked_pad import BookedPad
from skyway_composition.planning.availability import Succession
from skyway_composition.planning.problem_for import (
    Standing,
    delivery_problem,
    standby_problem,
    with_margins,
)
from skyway_composition.planning.solver_pool import SolverPool
from skyway_composition.planning.standby import StandbyChoice
from skyway_composition.planning.trip import Trip, soc_after
from skyway_composition.planning.world import World, compose_in

#: The plan of a drone without packages left to deliver.
NOTHING_TO_DELIVER = Plan(
    status=PlanStatus.OPTIMAL,
    delivery_time_s=0.0,
    lower_bound_s=0.0,
    energy_j=0.0,
    flight_s=0.0,
    waiting_s=0.0,
    recharging_s=0.0,
)


@dataclass(frozen=True, slots=True)
class NoTrip:
    """Why there is no trip; `is_temporary` when other reservations may be the cause.

    `data` holds the numbers behind the code, by name.
    """

    code: ProviderReasonCode
    detail: str
    is_temporary: bool
    data: tuple[tuple[str, float], ...] = ()


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
        return _no_plan(plan)
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

    async def trip_to(end: StationId) -> Trip | NoTrip:
        return await _with_way_to(
            solver, world, plan, drone=drone, end=end, start_ms=start_ms, held=held
        )

    network, start = world.skyway.network, drone.station_id
    parked = [await trip_to(end) for end in standby.to_compare(network, start)]
    charged = [each for each in parked if isinstance(each, Trip) and _is_charged(each, drone)]
    if charged:
        return min(charged, key=lambda each: each.released_ms)
    uncharged: Trip | None = None
    reason: NoTrip | None = None
    for end in standby.in_turn(network, start):
        trip = await trip_to(end)
        if isinstance(trip, NoTrip):
            reason = reason or trip
        elif standby.is_home(end) or _is_charged(trip, drone):
            return trip
        else:
            uncharged = uncharged or trip
    detail = f"home station {standby.home_station_id!r} is not in this network, and no pad is near"
    return uncharged or reason or NoTrip("NO_WAY_HOME", detail, is_temporary=False)


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
    home_start_ms = start_ms + booked_until_ms(plan.delivery_time_s or 0.0)
    problem = standby_problem(world, drone, station_id=end, start_ms=home_start_ms, held=held)
    home_plan = await compose_in(solver, world, problem)
    if not home_plan.is_flyable:
        reason = _no_plan(home_plan)
        detail = f"from {drone.station_id!r} to {end!r}: {reason.detail}"
        return NoTrip("NO_WAY_HOME", detail, is_temporary=reason.is_temporary)
    return Trip(
        start_ms=start_ms,
        plan=plan,
        home_start_ms=home_start_ms,
        home_plan=home_plan,
        home_recharge=_recharge_at_end(
            problem, home_plan, world.pads.book.seen_from(home_start_ms)
        ),
        pad_gap_ms=round(world.skyway.settings.pad_gap_s * 1000),
    )


def _is_charged(trip: Trip, drone: Standing) -> bool:
    """Whether the drone is charged to its top at the end of this trip."""
    if trip.home_recharge is not None:
        return True
    return soc_after(trip.home_plan, drone.soc) >= drone.model.top_soc - CHARGE_TOLERANCE


def _recharge_at_end(problem: Problem, home_plan: Plan, booked: PadBook) -> Recharge | None:
    """The earliest session that charges the drone to its top; None if not needed or no pad."""
    model, station_id = problem.drone.model, problem.packages[0].destination
    soc = soc_after(home_plan, problem.drone.soc)
    if soc >= model.top_soc - CHARGE_TOLERANCE:
        return None
    duration_s = recharge_time_s(model, soc, model.top_soc)
    arrived_s = home_plan.delivery_time_s or 0.0
    own = PadBook.of(problem.network, problem.pad_reservations)
    session = PadCalendar(problem.network, [own, booked]).earliest_session(
        station_id, not_before_s=arrived_s, duration_s=duration_s
    )
    if session is None:
        return None
    return Recharge(
        station_id=station_id,
        pad=session.pad,
        start_s=session.start_s,
        end_s=session.start_s + duration_s,
        soc_start=soc,
        soc_end=model.top_soc,
    )


def _last_station(plan: Plan, start: StationId) -> StationId:
    places = [step.station_id for step in plan.steps if isinstance(step, Deliver)]
    return places[-1] if places else start


def _no_plan(plan: Plan) -> NoTrip:
    if plan.infeasibility is None:
        return NoTrip("NO_PLAN_FOUND", "no plan was found in time", is_temporary=True)
    code, detail = plan.infeasibility.code, plan.infeasibility.detail
    return NoTrip(code, detail, is_temporary=code == "NO_PAD_IN_TIME")


@dataclass(slots=True)
class TripFinder:
    """Finds trips in one world; each distinct trip is composed once.

    Trips begin at `start_ms`. The drones in `after` begin later, after another mission, whose
    standby then ends early: its pads count as free. The last delivery must be over by `latest_ms`;
    None means no limit.
    """

    solver: SolverPool
    world: World
    start_ms: int
    latest_ms: int | None
    after: Mapping[DroneId, Succession] = field(default_factory=dict)
    _found: dict[object, Trip | NoTrip] = field(default_factory=dict)

    async def trip(
        self, candidate: Candidate, request: DeliveryRequest, *, held: Sequence[BookedPad] = ()
    ) -> Trip | NoTrip:
        """The trip of this candidate with the packages of a request; `held` pads are not free."""
        succession = self.after.get(candidate.drone_id)
        key = (
            succession,
            candidate.model,
            candidate.station_id,
            candidate.soc,
            StandbyChoice.of(candidate),
            request.packages,
            tuple(held),
        )
        found = self._found.get(key)
        if found is None:
            found = self._found[key] = await self._composed(candidate, request, held)
        return found

    def start_of(self, drone_id: DroneId) -> int:
        """The earliest start of this drone, fleet milliseconds."""
        succession = self.after.get(drone_id)
        return self.start_ms if succession is None else succession.slot.at_ms

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
        succession, world = self.after.get(candidate.drone_id), self.world
        if succession is not None:
            world = world.without([succession.mission_id])
        if latest_ms is not None and latest_ms < start_ms:
            detail = "the deadline lies before the earliest start"
            return self._with_deadline(NoTrip("TOO_LATE", detail, is_temporary=False), start_ms)
        problem = delivery_problem(
            world,
            Standing(candidate.model, candidate.soc, candidate.station_id),
            pickup=request.pickup.station_id,
            packages=request.packages,
            start_ms=start_ms,
            latest_ms=latest_ms,
            held=held,
        )
        trip = await round_trip(
            self.solver,
            world,
            problem,
            standby=StandbyChoice.of(candidate),
            held=held,
        )
        if isinstance(trip, NoTrip) and trip.code in ("TOO_LATE", "NO_PAD_IN_TIME"):
            return self._with_deadline(trip, start_ms)
        return trip

    def _with_deadline(self, reason: NoTrip, start_ms: int) -> NoTrip:
        if self.latest_ms is None:
            return reason
        return replace(reason, data=(("latest_s", (self.latest_ms - start_ms) / 1000),))
