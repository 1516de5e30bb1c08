"""Whether promises at P90 hold on each kind of day: planned, flown and learned, without services.

`python -m skyway_lab promises [--deliveries 600] [--seeds 1,2]` plans deliveries of one package in
the Texas corridor on calm, windy, cold and stormy days, with a forecast that is wrong by 1 m/s and
without one, and flies them as the experiment `weather` does. Without a forecast plans use the wind
and temperature that drones in flight measured just before, which fade as in composition. The days
come mixed at random, or in blocks of 100 deliveries of one kind. The P90 of each is learned from
the deliveries before. The first 400 of each order are not counted. The figures do not depend on the
machine.
"""

import argparse
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import fmean
from typing import Final, Literal

import numpy as np
from skyway_lab.benchmarks.planner.table import Table
from skyway_lab.experiments.contest import EXACT
from skyway_lab.experiments.figures import Axis, Stack, draw_groups
from skyway_lab.experiments.instances import chance, seed_of, texas_problem
from skyway_lab.experiments.weather import SETTING, as_planned
from skyway_lab.experiments.weather_day import DAYS, KindOfDay, Velocity, WeatherDay, fly_in_weather

from skyway.delivery.lateness import (
    MOST_RECHARGES,
    Conditions,
    KnownBy,
    PackageArrival,
    late_share,
    later_by_s,
)
from skyway.delivery.plan import Fly, Plan
from skyway.planner.compose import compose
from skyway.planner.forecast import planned_weather
from skyway.planner.known_air import air_in_forecast
from skyway.planner.measured_wind import HOLDS_S, MeasuredAir
from skyway.planner.problem import Problem
from skyway.planner.wind import SegmentWind

#: The kinds of days. The simulator's calm day has no wind at all, so each package would come to the
#: second: here it has some.
KINDS: Final[Mapping[str, KindOfDay]] = {
    "calm": KindOfDay(1.0, 0.4, power_noise=0.02),
    **DAYS,
}

#: The deliveries before the first that counts, those of one kind in a block, and the last ones from
#: which a P90 is learned, as in the gateway.
LEARNING: Final = 400
_IN_BLOCK: Final = 100
_LAST: Final = 600

#: The standard error of the wind in a forecast, m/s, and the drones that measure wind at a time.
_ERROR_MPS: Final = 1.0
_MEASURING: Final = 4

_LATE_S: Final = 600.0

Order = Literal["random", "blocks"]


@dataclass(frozen=True, slots=True)
class Flown:
    """A delivery that was planned and flown: what was known of it, and how late it came."""

    kind: str
    known: Conditions
    planned_s: float
    late_s: float

    @property
    def has_forecast(self) -> bool:
        """Whether its plan uses a forecast."""
        return self.known.air is not None and self.known.air.source == "FORECAST"


@dataclass(frozen=True, slots=True)
class Promised:
    """A flown delivery with the P90 that it was promised, seconds after its plan."""

    flown: Flown
    p90_s: float

    @property
    def is_in_time(self) -> bool:
        """Whether it came by its P90."""
        return self.flown.late_s <= self.p90_s


def flown_on(kind: str, *, has_forecast: bool, seed: int, deliveries: int) -> Iterator[Flown]:
    """Deliveries that are planned and flown on days of a kind; the mean wind has any direction."""
    for number in range(deliveries):
        own_seed = seed_of(seed, kind, number)
        problem = texas_problem(SETTING, seed=own_seed)
        day = WeatherDay.of(KINDS[kind], chance(f"{own_seed}/day"))
        found = _planned(problem, day, has_forecast=has_forecast, seed=own_seed)
        if found is None:
            continue
        plan, known = found
        planned_s = plan.delivery_time_s or 0.0
        late_s = fly_in_weather(problem, plan, day).delivered_s - planned_s
        yield Flown(kind, known, planned_s, round(late_s, 1))


def _planned(
    problem: Problem, day: WeatherDay, *, has_forecast: bool, seed: int
) -> tuple[Plan, Conditions] | None:
    """The plan, and what is known about it; None without a plan."""
    model = as_planned(problem.drone.model, day.kind)
    changes: dict[str, object] = {
        "strategy": EXACT,
        "drone": problem.drone.model_copy(update={"model": model}),
        "time_limit_s": 20.0,
    }
    seen_mps = _seen(day, has_forecast=has_forecast, seed=seed)
    forecast = day.kind.forecast(problem.network, seen_mps)
    if not has_forecast:
        error_mps = np.full((1, 1), MeasuredAir(*seen_mps, drones=_MEASURING).error_mps)
        forecast = replace(forecast, edges_s=np.array([0.0, HOLDS_S]), error_mps=error_mps)
    wind = SegmentWind.of(problem.network, forecast.field())
    changes["weather"] = planned_weather(wind, model)
    plan = compose(problem.model_copy(update=changes))
    flights = [step for step in plan.steps if isinstance(step, Fly)]
    if not plan.delivery_time_s or not flights:
        return None
    source: KnownBy = "FORECAST" if has_forecast else "MEASURED"
    air = air_in_forecast(forecast, wind, model, flights, start_s=0.0, source=source)
    return plan, air.conditions_of(plan)


def _seen(day: WeatherDay, *, has_forecast: bool, seed: int) -> Velocity:
    """The wind by the forecast, or the mean of the gusts that some drones measure."""
    error_mps = _ERROR_MPS if has_forecast else day.kind.gust_mps / math.sqrt(_MEASURING)
    random, (east, north) = chance(f"{seed}/seen"), day.wind_mps
    return east + random.gauss(0.0, error_mps), north + random.gauss(0.0, error_mps)


def in_order(flown: Sequence[Flown], order: Order, *, seed: int) -> list[Flown]:
    """The deliveries as the days come: mixed at random, or in blocks of one kind."""
    random = chance(f"{seed}/{order}")
    mixed = random.sample(flown, len(flown))
    if order == "random":
        return mixed
    left = {kind: [each for each in mixed if each.kind == kind] for kind in KINDS}
    ordered: list[Flown] = []
    while any(left.values()):
        for kind in random.sample(list(KINDS), len(KINDS)):
            ordered += left[kind][:_IN_BLOCK]
            left[kind] = left[kind][_IN_BLOCK:]
    return ordered


def promised(flown: Sequence[Flown]) -> list[Promised]:
    """The P90 of each delivery, learned from those before; without those that only teach."""
    come: list[PackageArrival] = []
    found: list[Promised] = []
    for number, each in enumerate(flown):
        share = late_share(each.known, come[-_LAST:])
        was_covered = None
        if share is not None:
            one = Promised(each, later_by_s(each.planned_s, share))
            was_covered = one.is_in_time
            if number >= LEARNING:
                found.append(one)
        come.append(PackageArrival(each.planned_s, each.late_s, was_covered, each.known))
    return found


def coverage(promises: Iterable[Promised]) -> dict[str, list[Promised]]:
    """The promises by kind of day, and by number of recharges."""
    groups: dict[str, list[Promised]] = {kind: [] for kind in KINDS}
    groups |= {recharges_in_words(number): [] for number in range(MOST_RECHARGES + 1)}
    for each in promises:
        groups[each.flown.kind].append(each)
        groups[recharges_in_words(each.flown.known.recharges)].append(each)
    return {name: group for name, group in groups.items() if group}


def recharges_in_words(number: int) -> str:
    """The group of a plan by its number of recharges."""
    if number >= MOST_RECHARGES:
        return f"{MOST_RECHARGES} or more recharges"
    return f"{number} recharge{'' if number == 1 else 's'}"


def measure(*, deliveries: int, seeds: Sequence[int]) -> dict[tuple[str, Order], list[Promised]]:
    """The promises of all seeds, by what is known of the weather, and by the order of days."""
    found: dict[tuple[str, Order], list[Promised]] = {}
    for seed in seeds:
        by_knowledge = {
            knowledge: [
                one
                for kind in KINDS
                for one in flown_on(
                    kind, has_forecast=has_forecast, seed=seed, deliveries=deliveries
                )
            ]
            for knowledge, has_forecast in (("forecast", True), ("no forecast", False))
        }
        orders: tuple[Order, ...] = ("random", "blocks")
        for order in orders:
            for knowledge, flown in by_knowledge.items():
                these = promised(in_order(flown, order, seed=seed))
                found.setdefault((knowledge, order), []).extend(these)
            both = [one for flown in by_knowledge.values() for one in flown]
            these = promised(in_order(both, order, seed=seed))
            for knowledge, has_forecast in (("forecast", True), ("no forecast", False)):
                own = [each for each in these if each.flown.has_forecast == has_forecast]
                found.setdefault((f"{knowledge}, among both", order), []).extend(own)
    return found


def table(found: Mapping[tuple[str, Order], Sequence[Promised]]) -> Table:
    """Coverage, mean width and the share of late packages, a row for each group."""
    header = ("weather known by", "days", "group", "by P90", "P90 after the plan", "10 min later")
    rows: list[tuple[str, ...]] = [
        (knowledge, order, name, *_figures(group))
        for (knowledge, order), promises in found.items()
        for name, group in {**coverage(promises), "all": promises}.items()
    ]
    caption = "Packages that came by their P90, after 400 deliveries."
    return Table("promises", caption, header, rows)


def _figures(group: Sequence[Promised]) -> tuple[str, str, str]:
    late = fmean(each.flown.late_s > each.p90_s + _LATE_S for each in group)
    return (
        f"{fmean(each.is_in_time for each in group):.1%} of {len(group)}",
        f"{fmean(each.p90_s for each in group) / 60:.1f} min",
        f"{late:.1%}",
    )


def draw(found: Mapping[tuple[str, Order], Sequence[Promised]], path: Path) -> None:
    """A figure of the coverage: groups of bars by kind of day and by number of recharges."""
    groups = [name.partition(" recharge")[0] for name in coverage(next(iter(found.values())))]
    draw_groups(
        path,
        "Packages that came by their P90",
        x=Axis("kind of day, and number of recharges of the plan"),
        y=Axis("share of the packages, %"),
        groups=groups,
        bars=[
            Stack(
                f"{knowledge}, {order}",
                [
                    100 * fmean(each.is_in_time for each in group)
                    for group in coverage(promises).values()
                ],
            )
            for (knowledge, order), promises in found.items()
            if "both" not in knowledge
        ],
    )


def main() -> None:
    """Fly and promise, and print the table."""
    parser = argparse.ArgumentParser(prog="python -m skyway_lab promises", description=__doc__)
    parser.add_argument("--deliveries", type=int, default=600, help="of each kind of day")
    parser.add_argument("--seeds", default="1", help="whole numbers, separated by commas")
    parser.add_argument(
        "--figure", type=Path, help="draw the coverage into this file, .svg or .png"
    )
    given = parser.parse_args()
    seeds = [int(each) for each in given.seeds.split(",")]
    found = measure(deliveries=given.deliveries, seeds=seeds)
    print(table(found).as_markdown())
    if given.figure is not None:
        draw(found, given.figure)


if __name__ == "__main__":
    main()
