"""The rolling hour with windows, and with batches of seconds.

A third of the requests were made before the hour, with a window for the delivery that begins at a
quarter of an hour, 30 to 150 minutes after the hour begins.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from statistics import mean
from typing import Final

from skyway_lab.benchmarks.dispatch.promises import cell, flown, searching
from skyway_lab.benchmarks.planner.table import Table
from skyway_lab.experiments.dispatched_hour.cases import FleetCase, fleet_case
from skyway_lab.experiments.dispatched_hour.rolling import RollingHour
from skyway_lab.experiments.fleet_hour.cases import HourRequest, Load, Place
from skyway_lab.experiments.instances import chance

#: Promises of a moment are one minute wide, and firm with the first plan after a minute.
_MOMENT: Final = replace(searching(), firm_within_s=60.0, promise_tolerance_s=60.0)

#: The windows that are promised, minutes; 0 stands for the moment of the plan.
_WINDOWS_MIN: Final = (0, 15, 30)

#: Few enough requests that drones are idle when windows are promised. Our own choice.
_LOAD: Final = Load(10, 30)

#: A delivery that comes so much after its window has missed it.
_LATE_S: Final = 60.0

#: Batches, and when their promises are firm at the earliest, seconds.
_BATCHES_S: Final = ((5.0, 0.0), (15.0, 0.0), (30.0, 0.0), (5.0, 60.0))


def windows(*, seeds: Sequence[int]) -> Iterator[Table]:
    """Mean minutes of the requests without a window, and how many windows were missed."""
    table = Table(
        "windows",
        f"city, {_LOAD}, a third with a window",
        ("promised", "others, min", "after the window begins, min", "missed"),
    )
    for length_min in _WINDOWS_MIN:
        policy = replace(_MOMENT, window_s=60.0 * length_min)
        hours = flown([_with_windows(seed) for seed in seeds], seeds, policy)
        promised = f"{length_min} min" if length_min else "the moment"
        table.rows.append((promised, *_measured(hours, 60 * (length_min or 15))))
    yield table


def batches(cases: Sequence[tuple[Place, Load]], *, seeds: Sequence[int]) -> Iterator[Table]:
    """Mean minutes if requests wait so long to be planned together."""
    for place, load in cases:
        table = Table("batches", f"{place}, {load}", ("batch", "firm after", "mean, min"))
        drawn = [fleet_case(place, load, seed=seed) for seed in seeds]
        for batch_s, firm_s in _BATCHES_S:
            policy = replace(_MOMENT, batch_s=batch_s, firm_within_s=firm_s)
            hours = flown(drawn, seeds, policy)
            table.rows.append((f"{batch_s:g} s", f"{firm_s:g} s", cell(hours)))
        yield table


def _with_windows(seed: int) -> FleetCase:
    """The case in which every third request has a window, and is known when the hour begins."""
    case, random = fleet_case("city", _LOAD, seed=seed), chance(f"{seed}/windows")

    def scheduled(asked: HourRequest) -> HourRequest:
        begin = {"not_before_s": 900.0 * random.randrange(2, 11)}
        packages = tuple(each.model_copy(update=begin) for each in asked.packages)
        return replace(asked, asked_ms=0, packages=packages)

    requests = [each if each.number % 3 else scheduled(each) for each in case.hour.requests]
    return replace(case, hour=replace(case.hour, requests=tuple(requests)))


def _measured(hours: Sequence[RollingHour], length_s: float) -> tuple[str, str, str]:
    """Mean minutes of the others, mean minutes after the begin of a window, and missed windows."""
    means, after_s = [], []
    for hour in hours:
        others = []
        for each in hour.case.hour.requests:
            delivered_ms, begin_s = hour.delivered_ms[each.number], each.packages[0].not_before_s
            if begin_s is None:
                others.append((delivered_ms - each.asked_ms) / 60_000)
            else:
                after_s.append(delivered_ms / 1000 - begin_s)
        means.append(mean(others))
    missed = sum(each > length_s + _LATE_S for each in after_s)
    by_seed = ", ".join(f"{each:.1f}" for each in means)
    return (
        f"{mean(means):.1f} ({by_seed})",
        f"{mean(after_s) / 60:.1f}",
        f"{missed} of {len(after_s)}",
    )
