"""Find a drone's whole trip: the delivery, the way home after it, and the recharge at home."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from skyway.contracts.candidate import Candidate, ProviderReasonCode
from skyway.delivery.plan import Deliver, Plan, PlanStatus, Recharge
from skyway.delivery.request import DeliveryRequest
from skyway.drone.charging import recharge_time_s
from skyway.ids import StationId
from skyway.network.great_circle import distances_m
from skyway.network.network import Network
from skyway.planner.pad_book import PadBook, booked_until_ms
from skyway.planner.pad_calendar import PadCalendar
from skyway.planner.problem import Problem
from skyway.units import CHARGE_TOLERANCE, moment_to_ms
from skyway_composition.pads.booked_pad import BookedPad
from skyway_composition.planning.problem_for import (
    Standing,
    delivery_problem,
    home_problem,
    with_margins,
)
from skyway_composition.planning.solver_pool import SolverPool
from skyway_composition.planning.trip import Trip, soc_after
from skyway_composition.planning.world import World, compose_in

#: How many near stations are tried for a drone that cannot fly home. Our own choice.
_MOST_ENDS: Final = 3

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
    home_station_id: StationId,
    held: Sequence[BookedPad] = (),
) -> Trip | NoTrip:
    """The problem's plan with the way home after its last delivery.

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
    return await _with_way_home(
        solver,
        world,
        plan,
        drone=drone,
        home_station_id=home_station_id,
        start_ms=start_ms,
        held=held,
    )


async def way_home(
    solver: SolverPool,
    world: World,
    plan: Plan,
    *,
    standing: Standing,
    home_station_id: StationId,
    start_ms: int,
) -> Trip | NoTrip:
    """The trip of a drone that is `standing` at the end of `plan`, flies home and recharges."""
    return await _with_way_home(
        solver,
        world,
        plan,
        drone=with_margins(world, standing),
        home_station_id=home_station_id,
        start_ms=start_ms,
    )


async def _with_way_home(
    solver: SolverPool,
    world: World,
    plan: Plan,
    *,
    drone: Standing,
    home_station_id: StationId,
    start_ms: int,
    held: Sequence[BookedPad] = (),
) -> Trip | NoTrip:
    """The trip with the way home, or to a near station with pads when home is out of reach."""
    reason: NoTrip | None = None
    for end in _ends(world.skyway.network, drone.station_id, home_station_id):
        trip = await _with_way_to(
            solver, world, plan, drone=drone, end=end, start_ms=start_ms, held=held
        )
        if isinstance(trip, Trip):
            return trip
        reason = reason or trip
    detail = f"home station {home_station_id!r} is not in this network, and no pad is near"
    return reason or NoTrip("NO_WAY_HOME", detail, is_temporary=False)


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
    problem = home_problem(world, drone, home_station_id=end, start_ms=home_start_ms, held=held)
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
        home_recharge=_recharge_at_home(
            problem, home_plan, world.pads.book.seen_from(home_start_ms)
        ),
        pad_gap_ms=round(world.skyway.settings.pad_gap_s * 1000),
    )


def _ends(network: Network, start: StationId, home_station_id: StationId) -> Iterator[StationId]:
    """Where a drone may go after its last delivery: home, then the nearest stations with pads."""
    if home_station_id in network.row_of:
        yield home_station_id
    columns = network.columns
    with_pads = np.flatnonzero(columns.pads > 0)
    here = np.full(len(with_pads), network.row_of[start])
    away_m = distances_m(
        (columns.longitude_deg[here], columns.longitude_deg[with_pads]),
        (columns.latitude_deg[here], columns.latitude_deg[with_pads]),
    )
    nearest = with_pads[np.argsort(away_m, kind="stable")[:_MOST_ENDS]]
    yield from (columns.station_ids[each] for each in nearest.tolist())


def _recharge_at_home(problem: Problem, home_plan: Plan, booked: PadBook) -> Recharge | None:
    """The earliest session that charges the drone to its top; None if not needed or no pad."""
    model, home_station_id = problem.drone.model, problem.packages[0].destination
    soc = soc_after(home_plan, problem.drone.soc)
    if soc >= model.top_soc - CHARGE_TOLERANCE:
        return None
    duration_s = recharge_time_s(model, soc, model.top_soc)
    arrived_s = home_plan.delivery_time_s or 0.0
    own = PadBook.of(problem.network, problem.pad_reservations)
    session = PadCalendar(problem.network, [own, booked]).earliest_session(
        home_station_id, not_before_s=arrived_s, duration_s=duration_s
    )
    if session is None:
        return None
    return Recharge(
        station_id=home_station_id,
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
    """Finds trips in one world for one start; each distinct trip is composed once.

    The last delivery must be over by `latest_ms`; None means no limit.
    """

    solver: SolverPool
    world: World
    start_ms: int
    latest_ms: int | None
    _found: dict[object, Trip | NoTrip] = field(default_factory=dict)

    async def trip(
        self, candidate: Candidate, request: DeliveryRequest, *, held: Sequence[BookedPad] = ()
    ) -> Trip | NoTrip:
        """The trip of this candidate with the packages of a request; `held` pads are not free."""
        key = (
            candidate.model,
            candidate.station_id,
            candidate.soc,
            candidate.home_station_id,
            request.packages,
            tuple(held),
        )
        found = self._found.get(key)
        if found is None:
            found = self._found[key] = await self._composed(candidate, request, held)
        return found

    async def _composed(
        self, candidate: Candidate, request: DeliveryRequest, held: Sequence[BookedPad]
    ) -> Trip | NoTrip:
        latest_ms = self.latest_ms
        if latest_ms is not None and latest_ms < self.start_ms:
            detail = "the deadline lies before the earliest start"
            return self._with_deadline(NoTrip("TOO_LATE", detail, is_temporary=False))
        problem = delivery_problem(
            self.world,
            Standing(candidate.model, candidate.soc, candidate.station_id),
            pickup=request.pickup.station_id,
            packages=request.packages,
            start_ms=self.start_ms,
            latest_ms=latest_ms,
            held=held,
        )
        trip = await round_trip(
            self.solver,
            self.world,
            problem,
            home_station_id=candidate.home_station_id,
            held=held,
        )
        if isinstance(trip, NoTrip) and trip.code in ("TOO_LATE", "NO_PAD_IN_TIME"):
            return self._with_deadline(trip)
        return trip

    def _with_deadline(self, reason: NoTrip) -> NoTrip:
        if self.latest_ms is None:
            return reason
        return replace(reason, data=(("latest_s", (self.latest_ms - self.start_ms) / 1000),))
