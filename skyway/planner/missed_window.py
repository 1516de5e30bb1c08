"""Which window cannot be met, and by how much it is missed."""

import math
from dataclasses import replace

from skyway.delivery.plan import Infeasibility
from skyway.ids import StationId
from skyway.planner.exact_search import Ending, ExactSearch
from skyway.planner.exact_task import Method
from skyway.planner.situation import Situation
from skyway.planner.stop import Effort
from skyway.units import time_tolerance_s

#: Seconds to which the lateness is found, and labels of one trial. Our own choice.
_STEP_S = 0.25
_TRIAL_LABELS = 1 << 14

#: Seconds, a month: a window that is missed by more is reported without the lateness.
_MOST_S = 30 * 86_400.0


def window_missed(situation: Situation, effort: Effort) -> Infeasibility:
    """WINDOW_MISSED for the first window that no plan meets, in the order of their ends.

    The windows' ends are added one by one, the earliest first. The first end that leaves no plan
    is named, with the least lateness at which there is a plan.
    """
    for place, (from_s, until_s) in situation.windows.limits.items():
        if from_s > until_s + time_tolerance_s(until_s) / 2:
            detail = f"no moment lies in all windows at {place!r}"
            return Infeasibility(code="WINDOW_MISSED", detail=detail, station_id=place)
    kept: dict[StationId, float] = {}
    ending = _try(situation, kept, effort)
    if ending is Ending.EXHAUSTED:
        detail = "what is closed leaves no way to deliver everything after each not_before_s"
        return Infeasibility(code="WINDOW_MISSED", detail=detail)
    ends = sorted(
        (until_s, place)
        for place, (_, until_s) in situation.windows.limits.items()
        if until_s < math.inf
    )
    for until_s, place in ends:
        kept[place] = until_s
        ending = _try(situation, kept, effort)
        if ending is Ending.EXHAUSTED:
            late_s = _least_lateness_s(situation, kept, place, effort)
            return Infeasibility(
                code="WINDOW_MISSED",
                detail=_detail(situation, place, late_s),
                station_id=place,
                late_s=late_s,
            )
        if ending is Ending.PAUSED:
            break
    return Infeasibility(code="WINDOW_MISSED", detail="the windows cannot all be met")


def _detail(situation: Situation, place: StationId, late_s: float | None) -> str:
    what = _act(situation, place)
    by = "" if late_s is None else f"; with every pad free it is over {late_s:.0f} s too late"
    is_alone = all(
        each == place or until_s == math.inf
        for each, (_, until_s) in situation.windows.limits.items()
    )
    others = "" if is_alone else ", if the windows that end before are met"
    return f"{what}{others}{by}"


def _act(situation: Situation, place: StationId) -> str:
    """The act at this place that cannot be over in time, with the field that limits it."""
    problem = situation.problem
    until_s = situation.windows.limits[place][1]
    latest_s, takes_s = problem.loading.latest_s, problem.loading.takes_s
    if place == problem.source and latest_s is not None and latest_s - takes_s <= until_s:
        return f"loading at {place!r} cannot be over by pickup_latest_s {latest_s:g}"
    latest_s, package_id = min(
        (package.latest_s, package.package_id)
        for package in situation.packages_for(place)
        if package.latest_s is not None
    )
    return f"package {package_id!r} cannot be handed over at {place!r} by latest_s {latest_s:g}"


def _least_lateness_s(
    situation: Situation, kept: dict[StationId, float], place: StationId, effort: Effort
) -> float | None:
    """The least lateness at this place with which the windows kept leave a plan; None if unknown.

    Rounded to a whole second.
    """
    until_s = kept[place]
    low_s, high_s = 0.0, 60.0
    while _try(situation, {**kept, place: until_s + high_s}, effort) is not Ending.PROVEN:
        low_s, high_s = high_s, 2 * high_s
        if high_s > _MOST_S:
            return None
    while high_s - low_s > _STEP_S:
        middle_s = (low_s + high_s) / 2
        if _try(situation, {**kept, place: until_s + middle_s}, effort) is Ending.PROVEN:
            high_s = middle_s
        else:
            low_s = middle_s
    return round(high_s)


def _try(situation: Situation, ends_s: dict[StationId, float], effort: Effort) -> Ending:
    """How a search ends that keeps the beginnings of all windows, and these ends."""
    windows = situation.windows.ending(ends_s)
    search = ExactSearch(replace(situation, windows=windows), method=Method())
    return search.run(effort, most_labels=min(_TRIAL_LABELS, effort.room))
