"""Finds the standby of a trip: where the drone goes after its last delivery, and charges.

The search says to which station a trip is to be planned next. Its caller plans the trip and answers
with it. So the same search serves a service, which awaits its planner, and an experiment.
"""

from collections.abc import Callable, Generator

from skyway.delivery.plan import Plan, Recharge
from skyway.drone.charging import recharge_time_s
from skyway.drone.model import DroneModel
from skyway.ids import StationId
from skyway.network.network import Network
from skyway.planner.pad_book import PadBook, booked_until_ms
from skyway.planner.pad_calendar import PadCalendar
from skyway.planner.problem import DroneAtStart, Problem
from skyway.scheduling.standby_choice import StandbyChoice
from skyway.scheduling.trip import NoTrip, Trip, soc_after
from skyway.units import CHARGE_TOLERANCE

#: Yields the station of each standby to try, takes the trip to it, and returns the best trip.
StandbySearch = Generator[StationId, Trip | NoTrip, Trip | NoTrip]


def search_standby(
    choice: StandbyChoice, network: Network, *, start: StationId, drone: DroneAtStart
) -> StandbySearch:
    """Search for the best end that the drone reaches, and where it charges if one has a pad.

    `drone` is the drone at the end of its plan, which is at `start`.
    """
    charged: list[Trip] = []
    for end in choice.to_compare(network, start):
        trip = yield end
        if isinstance(trip, Trip) and _is_charged(trip, drone):
            charged.append(trip)
    if charged:
        return min(charged, key=lambda each: each.released_ms)
    uncharged: Trip | None = None
    reason: NoTrip | None = None
    for end in choice.in_turn(network, start):
        trip = yield end
        if isinstance(trip, NoTrip):
            reason = reason or trip
        elif choice.is_home(end) or _is_charged(trip, drone):
            return trip
        else:
            uncharged = uncharged or trip
    detail = f"home station {choice.home_station_id!r} is not in this network, and no pad is near"
    return uncharged or reason or NoTrip("NO_WAY_HOME", detail, is_temporary=False)


def run_search(
    search: StandbySearch, trip_to: Callable[[StationId], Trip | NoTrip]
) -> Trip | NoTrip:
    """The result of a search, whose trips `trip_to` plans."""
    try:
        end = next(search)
        while True:
            end = search.send(trip_to(end))
    except StopIteration as found:
        trip: Trip | NoTrip = found.value
        return trip


def home_start_ms(plan: Plan, *, start_ms: int) -> int:
    """The moment from which the seconds of a standby count: the end of the plan before it."""
    return start_ms + booked_until_ms(plan.delivery_time_s or 0.0)


def trip_by_way_home(
    plan: Plan,
    problem: Problem,
    home_plan: Plan,
    *,
    start_ms: int,
    booked: PadBook,
    pad_gap_ms: int,
) -> Trip | NoTrip:
    """The trip of a plan that begins at `start_ms`, and of its standby.

    Parameters
    ----------
    problem, home_plan
        The flight to where the drone stands by, and its plan.
    booked
        The reservations of other drones, in seconds since the standby's start, beside those of the
        problem itself.
    """
    if not home_plan.is_flyable:
        reason = no_plan(home_plan)
        end = problem.packages[0].destination
        detail = f"from {problem.source!r} to {end!r}: {reason.detail}"
        return NoTrip("NO_WAY_HOME", detail, is_temporary=reason.is_temporary)
    return Trip(
        start_ms=start_ms,
        plan=plan,
        home_start_ms=home_start_ms(plan, start_ms=start_ms),
        home_plan=home_plan,
        home_recharge=_recharge_at_end(problem, home_plan, booked),
        pad_gap_ms=pad_gap_ms,
    )


def no_plan(plan: Plan) -> NoTrip:
    """Why there is no trip, from a plan that cannot be flown."""
    if plan.infeasibility is None:
        return NoTrip("NO_PLAN_FOUND", "no plan was found in time", is_temporary=True)
    why = plan.infeasibility
    return NoTrip(
        why.code,
        why.detail,
        is_temporary=why.code == "NO_PAD_IN_TIME",
        data=() if why.late_s is None else (("late_s", why.late_s),),
        missed_at=why.station_id,
    )


def _is_charged(trip: Trip, drone: DroneAtStart) -> bool:
    """Whether the drone is charged to its top at the end of this trip."""
    if trip.home_recharge is not None:
        return True
    return _is_top(drone.model, soc_after(trip.home_plan, drone.soc))


def _is_top(model: DroneModel, soc: float) -> bool:
    return soc >= model.top_soc - CHARGE_TOLERANCE


def _recharge_at_end(problem: Problem, home_plan: Plan, booked: PadBook) -> Recharge | None:
    """The earliest session that charges the drone to its top; None if not needed or no pad."""
    model, station_id = problem.drone.model, problem.packages[0].destination
    soc = soc_after(home_plan, problem.drone.soc)
    if _is_top(model, soc):
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
