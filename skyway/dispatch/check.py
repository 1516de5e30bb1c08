"""Checks a fleet plan: every trip by the planner's own `verify`, and no pad or drone twice."""

from collections.abc import Iterator

from skyway.dispatch.pads import PadLedger
from skyway.dispatch.plan import FleetPlan
from skyway.dispatch.problem import FleetProblem
from skyway.dispatch.trips import PlannedTrip, TripPlanner
from skyway.planner.pad_book import booked_until_ms
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
    trips = []
    for number, (drone, trip) in enumerate(_follow_drones(problem, plan)):
        if isinstance(trip, str):
            yield f"trips.{number}: {trip}"
            return
        trips.append((drone, trip))
    for number, (drone, trip) in enumerate(trips):
        gap_ms = booked_until_ms(problem.pad_gap_s)
        pads = PadLedger(problem.network, problem.pad_reservations, gap_ms=gap_ms)
        pads.hold(
            pad for other, (_, one) in enumerate(trips) if other != number for pad in one.pads
        )
        booked = pads.book(from_ms=trip.slot.at_ms).seen_from(trip.slot.at_ms)
        own = planner.problem_of(trip.pool, drone, trip.slot)
        for violation in verify(own, trip.plan, booked=booked):
            yield f"trips.{number}: {violation}"


def _follow_drones(
    problem: FleetProblem, plan: FleetPlan
) -> Iterator[tuple[int, PlannedTrip | str]]:
    """The drone's number and the trip, or what is wrong with its place behind the trip before."""
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
        if round(each.start_s * 1000) != slot.at_ms:
            yield drone, f"starts at {each.start_s}, the drone is free at {slot.at_ms / 1000}"
            return
        pool = tuple(requests[one.request_id] for one in each.requests)
        fault = _fault_of_sharing(problem, pool)
        if fault is not None:
            yield drone, fault
            return
        trip = PlannedTrip.of(
            pool, [problem.requests[one] for one in pool], slot=slot, plan=each.plan
        )
        stated_ms = tuple(round(one.delivered_s * 1000) for one in each.requests)
        yield drone, trip if trip.delivered_ms == stated_ms else "delivered_s is not the plan's"
        free_ms = trip.end.at_ms + booked_until_ms(problem.hand_over_s)
        slots[drone] = Slot(trip.end.station_id, free_ms, trip.end.soc)


def _fault_of_sharing(problem: FleetProblem, pool: tuple[int, ...]) -> str | None:
    """Why these requests may not share a trip, None if they may."""
    if len(pool) == 1:
        return None
    shared = [problem.requests[each] for each in pool]
    if len(pool) > problem.most_pooled:
        return f"{len(pool)} requests share it, the limit is {problem.most_pooled}"
    if not all(each.pooling for each in shared):
        return "a request shares it that does not allow pooling"
    if len({each.source for each in shared}) > 1:
        return "its requests have different pick-ups"
    return None
