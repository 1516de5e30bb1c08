"""Checks a fleet plan: `verify` accepts each trip, and no pad or drone is used twice."""

from collections.abc import Iterator

from skyway.delivery.plan import PickUp, Plan
from skyway.dispatch.pads import FleetPads
from skyway.dispatch.plan import FleetPlan
from skyway.dispatch.planned_trip import PlannedTrip
from skyway.dispatch.pools import pickups_of
from skyway.dispatch.problem import FleetProblem
from skyway.dispatch.trips import TripPlanner
from skyway.ids import StationId
from skyway.planner.pad_book import booked_until_ms
from skyway.planner.problem import Problem
from skyway.planner.verify import verify
from skyway.scheduling.stays import Slot


def violations(problem: FleetProblem, plan: FleetPlan) -> tuple[str, ...]:
    """Every rule that the plan breaks, as sentences; empty for a good plan."""
    return tuple(_violations(problem, plan))


def _violations(problem: FleetProblem, plan: FleetPlan) -> Iterator[str]:
    named = [one.request_id for each in plan.trips for one in each.requests]
    named += [each.request_id for each in plan.unserved]
    if sorted(named) != sorted(each.request_id for each in problem.requests):
        yield "not every request is either served once or unserved"
        return
    planner = TripPlanner(problem)
    trips: list[tuple[int, PlannedTrip, Plan]] = []
    for number, (drone, trip) in enumerate(_follow_drones(problem, plan)):
        if isinstance(trip, str):
            yield f"trips.{number}: {trip}"
            return
        if not planner.may_fly(planner.model_of[drone], trip.pool):
            yield f"trips.{number}: its provider may not fly a request"
        trips.append((drone, trip, plan.trips[number].plan))
    for number, (drone, trip, own_plan) in enumerate(trips):
        pads = FleetPads(problem)
        pads.hold(
            pad for other, (_, one, _) in enumerate(trips) if other != number for pad in one.pads
        )
        booked = pads.book().seen_from(trip.slot.at_ms)
        own = planner.problem_of(trip.pool, drone, trip.slot, source=_loaded_at(own_plan))
        if len(trip.pool) > 1 and any(
            problem.requests[one].promised_s is not None for one in trip.pool
        ):
            own = _with_windows(own, own_plan)
        for violation in verify(own, own_plan, booked=booked):
            yield f"trips.{number}: {violation}"


def _with_windows(own: Problem, plan: Plan) -> Problem:
    """The problem of a shared trip that was planned with promises as windows.

    With windows a drone may wait or recharge where it hands over next. Each window here ends when
    the plan hands over.
    """
    ends_s = {each.package_id: each.delivered_s for each in plan.deliveries}
    packages = tuple(
        each.model_copy(update={"latest_s": ends_s[each.package_id]})
        if each.latest_s is None and each.package_id in ends_s
        else each
        for each in own.packages
    )
    return own.model_copy(update={"packages": packages})


def _follow_drones(
    problem: FleetProblem, plan: FleetPlan
) -> Iterator[tuple[int, PlannedTrip | str]]:
    """The drone's number and its trip, or why the trip cannot follow the drone's trip before it."""
    drones = {each.drone_id: number for number, each in enumerate(problem.drones)}
    requests = {each.request_id: number for number, each in enumerate(problem.requests)}
    slots = [
        Slot(each.station_id, booked_until_ms(each.free_s), each.soc) for each in problem.drones
    ]
    for each in plan.trips:
        drone = drones.get(each.drone_id)
        if drone is None:
            yield -1, f"there is no drone {each.drone_id!r}"
            return
        slot = slots[drone]
        # Both moments are rounded up to milliseconds; their parts were added in another order.
        if abs(round(each.start_s * 1000) - slot.at_ms) > 1:
            yield drone, f"starts at {each.start_s}, the drone is free at {slot.at_ms / 1000}"
            return
        slot = Slot(slot.station_id, round(each.start_s * 1000), slot.soc)
        pool = tuple(requests[one.request_id] for one in each.requests)
        fault = _fault_of_sharing(problem, pool, each.plan)
        if fault is not None:
            yield drone, fault
            return
        trip = PlannedTrip.of(
            pool, [problem.requests[one] for one in pool], slot=slot, plan=each.plan
        )
        is_stated = all(
            abs(one.delivered_s * 1000 - moment_ms) <= 1.5
            for one, moment_ms in zip(each.requests, trip.delivered_ms, strict=True)
        )
        yield drone, trip if is_stated else "delivered_s is not that of its plan"
        free_ms = trip.end.at_ms + booked_until_ms(problem.hand_over_s)
        slots[drone] = Slot(trip.end.station_id, free_ms, trip.end.soc)


def _loaded_at(plan: Plan) -> StationId | None:
    """Where a plan picks up its packages; None if it does not say."""
    return next((each.station_id for each in plan.steps if isinstance(each, PickUp)), None)


def _fault_of_sharing(problem: FleetProblem, pool: tuple[int, ...], plan: Plan) -> str | None:
    """Why these requests may not have this trip, None if they may."""
    shared = [problem.requests[each] for each in pool]
    if _loaded_at(plan) not in pickups_of(shared):
        return "it is not loaded at a common pickup of its requests"
    if len(pool) == 1:
        return None
    if len(pool) > problem.most_pooled:
        return f"{len(pool)} requests share it, the limit is {problem.most_pooled}"
    if not all(each.pooling for each in shared):
        return "one of its requests does not allow pooling"
    return None
