"""Trips of requests with windows: how late they may begin, and which window is missed."""

from collections.abc import Awaitable, Callable
from itertools import pairwise
from typing import Final

from skyway.contracts.message import utc_text
from skyway.delivery.plan import Deliver, PickUp, Plan, Wait
from skyway.delivery.request import DeliveryRequest
from skyway.planner.problem import Problem
from skyway.scheduling.trip import NoTrip, Trip

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
