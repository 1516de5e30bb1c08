"""Plans around a landing that is not on the way: flown first, or where everything is left."""

from skyway.delivery.plan import Deliver, Fly, PickUp, Plan, PlanStatus, Step
from skyway.ids import PackageId
from skyway.planner.pad_book import booked_until_ms
from skyway_composition.missions.rest.landing import Landing
from skyway_composition.planning.find_trip import NOTHING_TO_DELIVER
from skyway_composition.planning.trip import Trip


def leaving_behind(landing: Landing, package_ids: frozenset[PackageId], *, start_ms: int) -> Trip:
    """Fly to this landing and leave there what is on board; the trip ends with that."""
    end_s = landing.at_s
    left: tuple[Step, ...] = ()
    if package_ids:
        left = (
            Deliver(
                station_id=landing.station_id,
                package_ids=tuple(sorted(package_ids)),
                start_s=end_s,
                end_s=end_s,
            ),
        )
    plan = _flown_first(
        landing, Plan(status=PlanStatus.FEASIBLE, delivery_time_s=0.0, energy_j=0.0, flight_s=0.0)
    )
    plan = plan.model_copy(update={"steps": (*plan.steps, *left)})
    return Trip(
        start_ms=start_ms,
        plan=plan,
        home_start_ms=start_ms + booked_until_ms(end_s),
        home_plan=NOTHING_TO_DELIVER,
        home_recharge=None,
    )


def by_way_of(landing: Landing, trip: Trip, *, start_ms: int) -> Trip:
    """Fly to this landing first, from where the trip was planned; from `start_ms` on."""
    return Trip(
        start_ms=start_ms,
        plan=_flown_first(landing, trip.plan, gap_s=(trip.start_ms - start_ms) / 1000),
        home_start_ms=trip.home_start_ms,
        home_plan=trip.home_plan,
        home_recharge=trip.home_recharge,
        pad_gap_ms=trip.pad_gap_ms,
    )


def staying(plan: Plan, *, start_ms: int, pad_gap_ms: int) -> Trip:
    """Fly this plan with everything on board, and hand nothing over at its end."""
    flown = tuple(each for each in plan.steps if not isinstance(each, PickUp | Deliver))
    return Trip(
        start_ms=start_ms,
        plan=plan.model_copy(update={"steps": flown, "deliveries": ()}),
        home_start_ms=start_ms + booked_until_ms(plan.delivery_time_s or 0.0),
        home_plan=NOTHING_TO_DELIVER,
        home_recharge=None,
        pad_gap_ms=pad_gap_ms,
    )


def takes_off_at_once(trip: Trip) -> bool:
    """Whether a trip begins with a flight, and nothing before it."""
    first = next((each for each in trip.steps() if each.step.kind != "PICK_UP"), None)
    return first is not None and isinstance(first.step, Fly) and first.start_ms <= trip.start_ms


def _flown_first(landing: Landing, plan: Plan, *, gap_s: float | None = None) -> Plan:
    """The plan with the flights to a landing before it; its own seconds count from `gap_s` on."""
    later_s = landing.at_s if gap_s is None else gap_s
    steps = tuple(_later(step, later_s) for step in plan.steps)
    deliveries = tuple(
        each.model_copy(update={"delivered_s": each.delivered_s + later_s})
        for each in plan.deliveries
    )
    flown_s = sum(flight.end_s - flight.start_s for flight in landing.flights)
    return plan.model_copy(
        update={
            "steps": (*landing.flights, *steps),
            "deliveries": deliveries,
            "delivery_time_s": (plan.delivery_time_s or 0.0) + later_s,
            "lower_bound_s": None,
            "flight_s": (plan.flight_s or 0.0) + flown_s,
            "energy_j": (plan.energy_j or 0.0) + sum(each.energy_j for each in landing.flights),
        }
    )


def _later(step: Step, by_s: float) -> Step:
    return step.model_copy(update={"start_s": step.start_s + by_s, "end_s": step.end_s + by_s})
