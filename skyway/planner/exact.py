"""The proven best plan: label setting over stations and delivered sets, guided by lower bounds.

docs/reference/planner-method.md explains the method. How long to stay on a pad is decided only when
a flight needs the charge, so any amount can be charged and nothing is rounded to a grid. `kernels`
holds the compiled search, `exact_search` its memory; `exact_itinerary` turns the result into steps.
If no plan is found, searching again with fewer obstacles proves why.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

from skyway.delivery.plan import Infeasibility
from skyway.ids import StationId
from skyway.planner.closures import Closures
from skyway.planner.exact_bounds import likely_delivery_s
from skyway.planner.exact_haste import Haste, earlier, itinerary_found
from skyway.planner.exact_search import Ending, ExactSearch
from skyway.planner.exact_task import Method
from skyway.planner.findings import Findings, Strategy
from skyway.planner.itinerary import Itinerary
from skyway.planner.missed_window import window_missed
from skyway.planner.pad_book import NO_RESERVATIONS
from skyway.planner.situation import Situation
from skyway.planner.stop import Effort
from skyway.units import time_tolerance_s

#: These searches begin when the limit's labels divided by this number are made.
ROOM_BEFORE_HASTE = 32

#: After so many labels the search for the proof pauses again, for a narrow search of this width.
#: Our own choice.
_WIDER = ((1 << 18, 256), (1 << 22, 1024))

#: With weather, the first searches look for plans that take up to so many times the likely time.
#: Our own choice.
_LATER_THAN_LIKELY = (1.3, 3.0)

#: Precision of the reported gap in range, as a share of the battery. Our own choice.
_GAP_STEP = 0.05

#: Labels of one test with a larger battery. Our own choice: about 10 ms.
_GAP_LABELS = 1 << 14


def exact(situation: Situation, effort: Effort) -> Findings:
    """The plan that delivers earliest, with its proof; or the proof that there is none."""
    return _find(situation, effort, Method(), None)


def exact_with(method: Method, *, order: Sequence[StationId] | None = None) -> Strategy:
    """The exact search with another method, or for one order of the destinations.

    What another method or order finds is not proven to be the best of the problem.
    """
    return lambda situation, effort: _find(situation, effort, method, order)


def _find(
    situation: Situation, effort: Effort, method: Method, order: Sequence[StationId] | None
) -> Findings:
    closed = _closed_for_good(situation)
    if closed is not None:
        return Findings(None, 0, infeasibility=closed)
    search, ending = _searched_before_haste(situation, effort, method, order)
    other = None
    if ending is Ending.PAUSED:
        haste = Haste(situation, effort, method, order)
        other = haste.plan()
        if situation.problem.weather is not None:
            # The bounds are higher if they hold only for periods before the best plan's end.
            until_s = math.inf if other is None else other.delivered_s
            search = ExactSearch(situation, method=method, order=order, until_s=until_s)
        if other is not None:
            search.improve_on(other.delivered_s)
        elif (proof := _unreachable_behind_closures(situation)) is not None:
            return Findings(None, search.stations_searched, infeasibility=proof)
        ending, other = _proven(search, effort, haste, other)
    itinerary = earlier(itinerary_found(situation, search), other)
    searched = search.stations_searched
    if itinerary is None and ending is Ending.EXHAUSTED:
        proof = _proof_of_infeasibility(situation, effort)
        return Findings(None, searched, infeasibility=proof)
    is_default = replace(method, labels_before_haste=Method().labels_before_haste) == Method()
    bound_s = search.lower_bound_s if is_default and order is None else None
    return Findings(itinerary, searched, _at_most(bound_s, itinerary))


def _searched_before_haste(
    situation: Situation, effort: Effort, method: Method, order: Sequence[StationId] | None
) -> tuple[ExactSearch, Ending]:
    """The search after its first labels; with weather first for early plans alone."""
    before_haste = min(method.labels_before_haste, effort.room // ROOM_BEFORE_HASTE)
    limits_s = [math.inf]
    weather = situation.problem.weather
    if weather is not None:
        likely_s = likely_delivery_s(situation)
        ends_s = [weather.end_of_period(likely_s * factor) for factor in _LATER_THAN_LIKELY]
        limits_s = sorted({*ends_s, math.inf})
    for until_s in limits_s:
        search = ExactSearch(situation, method=method, order=order, until_s=until_s)
        ending = search.run(effort, most_labels=before_haste)
        if ending is not Ending.EXHAUSTED:
            break
    return search, ending


def _proven(
    search: ExactSearch, effort: Effort, haste: Haste, best: Itinerary | None
) -> tuple[Ending, Itinerary | None]:
    """Go on with the search for the proof, with pauses for better plans; the best of these plans.

    `best` is the best plan so far.
    """
    for labels, width in _WIDER:
        ending = search.run(effort, most_labels=min(labels, effort.room))
        if ending is not Ending.PAUSED or effort.is_over:
            return ending, best
        best = earlier(itinerary_found(haste.situation, search), best)
        best = haste.better_plan(best, width=width)
        if best is not None:
            search.improve_on(best.delivered_s)
    return search.run(effort, most_labels=effort.room), best


def _at_most(bound_s: float | None, itinerary: Itinerary | None) -> float | None:
    """The bound, at most the plan's own time: sums of floats may make it a little later."""
    if bound_s is None or itinerary is None:
        return bound_s
    return min(bound_s, itinerary.delivered_s)


def _proof_of_infeasibility(situation: Situation, effort: Effort) -> Infeasibility | None:
    """The reason that excludes every plan; None when the effort ended first.

    The proof is a search without reservations, deadline and windows. If it finds a plan, the
    reserved pads, the deadline or the windows are the reason. If it finds none, the drone cannot
    get there.
    """
    free = _without_pressure(situation)
    search = ExactSearch(free, method=Method())
    ending = search.run(effort, most_labels=effort.room)
    if ending is Ending.EXHAUSTED:
        return (
            _unreachable(situation, search)
            or _closed_at_the_wrong_time(free, effort)
            or _out_of_range(free, effort)
        )
    if ending is Ending.PAUSED:
        return None
    least_s = search.lower_bound_s
    if situation.windows.may_pass:
        timely = replace(free, windows=situation.windows)
        search = ExactSearch(timely, method=Method())
        ending = search.run(effort, most_labels=effort.room)
        if ending is Ending.PAUSED:
            return None
        if ending is Ending.EXHAUSTED:
            return window_missed(timely, effort)
        least_s = search.lower_bound_s
    limit_s = situation.problem.latest_delivery_s
    if limit_s is not None and least_s > limit_s + time_tolerance_s(limit_s) / 2:
        return Infeasibility(
            code="TOO_LATE",
            detail=f"the earliest plan takes {least_s:.3f} s even with every pad free, "
            f"{least_s - limit_s:.3f} s more than latest_delivery_s {limit_s:g}",
        )
    when = "" if limit_s is None else f" by latest_delivery_s {limit_s:g}"
    return Infeasibility(
        code="NO_PAD_IN_TIME",
        detail=f"other reservations leave too few pads to deliver everything{when}; "
        f"with every pad free it would take {least_s:.3f} s",
    )


def _unreachable_behind_closures(situation: Situation) -> Infeasibility | None:
    """DESTINATION_UNREACHABLE if permanent closures cut a place off.

    The hierarchy's distances know of no closures, so a search that they guide would go through all
    the network before it is over.
    """
    if situation.hierarchy is None or not situation.closures.intervals():
        return None
    without = replace(situation, hierarchy=None)
    return _unreachable(situation, ExactSearch(without, method=Method()))


def _without_pressure(situation: Situation) -> Situation:
    """The same with every pad free, no deadline, and every window open."""
    problem = situation.problem.model_copy(update={"latest_delivery_s": None})
    return Situation(
        problem,
        situation.closures,
        (NO_RESERVATIONS, NO_RESERVATIONS),
        windows=situation.windows.opened(),
    )


def _unreachable(situation: Situation, search: ExactSearch) -> Infeasibility | None:
    """DESTINATION_UNREACHABLE for the first place to which no path leads, or that is closed."""
    missing = search.missing_path
    if missing is not None:
        detail = f"no path leads from {missing[0]!r} to {missing[1]!r}"
    elif not search.has_order:
        detail = "no order of the destinations has a path through all of them"
    else:
        return None
    return Infeasibility(code="DESTINATION_UNREACHABLE", detail=detail)


def _closed_for_good(situation: Situation) -> Infeasibility | None:
    """DESTINATION_UNREACHABLE for the first place of a plan that is closed without end."""
    problem = situation.problem
    places: list[StationId] = list(situation.destinations)
    if problem.start_station_id != problem.source:
        places.insert(0, problem.source)
    for place in places:
        if situation.closures.is_closed_for_good(place):
            detail = f"station {place!r} is closed for good"
            return Infeasibility(code="DESTINATION_UNREACHABLE", detail=detail)
    return None


def _closed_at_the_wrong_time(free: Situation, effort: Effort) -> Infeasibility | None:
    """DESTINATION_UNREACHABLE if there would be a plan with nothing closed, in still air."""
    has_weather = free.problem.weather is not None
    if not free.closures.intervals() and not has_weather:
        return None
    calm = free.problem.model_copy(update={"weather": None})
    opened = replace(free, problem=calm, closures=Closures({}), windows=free.windows.always())
    search = ExactSearch(opened, method=Method())
    if search.run(effort, most_labels=effort.room) is not Ending.PROVEN:
        return None
    names = ["closures", "zones"] if free.closures.intervals() else []
    names += ["opening hours"] if free.network.opening_hours else []
    names += ["the weather"] if has_weather else []
    what = " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
    without = [] if names == ["the weather"] else ["with nothing closed"]
    without += ["in still air"] if has_weather else []
    return Infeasibility(
        code="DESTINATION_UNREACHABLE",
        detail=f"{what} {'leave' if len(names) > 1 else 'leaves'} no way to deliver everything; "
        f"{' and '.join(without)} it would take {search.lower_bound_s:.3f} s",
    )


def _out_of_range(free: Situation, effort: Effort) -> Infeasibility:
    """OUT_OF_RANGE, with the battery that would be enough if one of a few sizes is."""
    model_id = free.model.model_id
    detail = (
        "even with every pad free and every recharge to the top of the charge curve "
        f"the {model_id} cannot fly to all destinations in turn"
    )
    share = _share_of_battery_missing(free, effort)
    if share is not None:
        detail += f"; with about {share:.0%} more battery it could"
    return Infeasibility(code="OUT_OF_RANGE", detail=detail)


def _share_of_battery_missing(free: Situation, effort: Effort) -> float | None:
    """How much larger the battery would have to be, to a twentieth; None if not twice as large."""
    low, high = 0.0, 1.0
    if not _reaches(free, 1.0 + high, effort):
        return None
    while high - low > _GAP_STEP:
        middle = (low + high) / 2
        if _reaches(free, 1.0 + middle, effort):
            high = middle
        else:
            low = middle
    return high


def _reaches(free: Situation, size: float, effort: Effort) -> bool:
    """Whether a battery of this many times the size would be enough, if that is cheap to find."""
    model = free.model.model_copy(update={"battery_j": free.model.battery_j * size})
    drone = free.problem.drone.model_copy(update={"model": model})
    problem = free.problem.model_copy(update={"drone": drone})
    search = ExactSearch(replace(free, problem=problem), method=Method())
    return search.run(effort, most_labels=min(_GAP_LABELS, effort.room)) is Ending.PROVEN
