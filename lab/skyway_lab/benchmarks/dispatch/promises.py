"""What promises cost in the rolling hour, by when they are firm and by their width.

The width is the same for all requests, or it grows with the time to the promised delivery.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from statistics import mean
from typing import Final

from skyway_lab.benchmarks.planner.table import Table
from skyway_lab.experiments.dispatched_hour.cases import FleetCase, fleet_case
from skyway_lab.experiments.dispatched_hour.policies import (
    DispatchPolicy,
    searched_in_rounds,
    searches,
)
from skyway_lab.experiments.dispatched_hour.rolling import RollingHour
from skyway_lab.experiments.figures import Axis, Line, draw_lines
from skyway_lab.experiments.fleet_hour.cases import Load, Place
from skyway_lab.experiments.sample import Estimate, Sample

#: Minutes until a promise is firm, and its width in minutes.
_FIRM_MIN: Final = (1, 10, 30)
_WIDTHS_MIN: Final = (1, 10, 30)

#: By how much a promise is wider for each second beyond `FAR_S`. Chosen so that promises of the
#: city that are firm after 1 min are 10 min wide on average.
_WIDER_BY: Final = 0.28

#: Rounds of the search for each plan, unless another number is given.
ROUNDS: Final = 2


def searching(*, rounds: int = ROUNDS, pooling: bool = False) -> DispatchPolicy:
    """The search of `live_hour`, in which each request flies alone, or with shared trips."""
    alone, shared, _ = searches(searched_in_rounds(rounds, most_steps=8_000))
    return shared if pooling else alone


def promises(
    cases: Sequence[tuple[Place, Load]], *, seeds: Sequence[int], rounds: int, figure: Path | None
) -> Iterator[Table]:
    """Mean minutes from each request to its last delivery, a table for each case."""
    lines = []
    for place, load in cases:
        own = searching(rounds=rounds, pooling=place == "three hubs")
        table = Table(
            "promises",
            f"{place}, {load}: firm after so many minutes",
            ("firm", *(f"{width} min wide" for width in _WIDTHS_MIN), "wider when far"),
        )
        for firm in _FIRM_MIN:
            found = [
                _hours(place, load, seeds, _promising(own, firm_min=firm, width_min=width))
                for width in _WIDTHS_MIN
            ]
            far_policy = _promising(own, firm_min=firm, width_min=0)
            far = _hours(place, load, seeds, replace(far_policy, wider_by=_WIDER_BY))
            width_min = mean(map(_mean_width_min, far))
            far_cell = f"{cell(far)}, {width_min:.0f} min wide"
            table.rows.append((f"{firm} min", *map(cell, found), far_cell))
            name = f"{place}, firm after {firm} min"
            lines.append(Line(name, _WIDTHS_MIN, [*map(_estimate, found)]))
            lines.append(Line(f"{name}, wider when far", [width_min], [_estimate(far)]))
        none = cell(_hours(place, load, seeds, own))
        table.rows.append(("no promise", *[none] * (len(_WIDTHS_MIN) + 1)))
        yield table
    if figure is not None:
        width, minutes = (
            Axis("width of the promise, min"),
            Axis("mean minutes to the last delivery"),
        )
        draw_lines(figure, "What promises cost", x=width, y=minutes, lines=lines)


def _promising(policy: DispatchPolicy, *, firm_min: float, width_min: float) -> DispatchPolicy:
    return replace(policy, firm_within_s=60.0 * firm_min, promise_tolerance_s=60.0 * width_min)


def _hours(
    place: Place, load: Load, seeds: Sequence[int], policy: DispatchPolicy
) -> list[RollingHour]:
    return flown([fleet_case(place, load, seed=seed) for seed in seeds], seeds, policy)


def flown(
    cases: Sequence[FleetCase], seeds: Sequence[int], policy: DispatchPolicy
) -> list[RollingHour]:
    """The hour of each case, flown."""
    hours = [RollingHour(case, policy, seed) for case, seed in zip(cases, seeds, strict=True)]
    for hour in hours:
        hour.run()
    return hours


def _mean_width_min(hour: RollingHour) -> float:
    return mean(hour.width_s(each) or 0.0 for each in hour.promised_ms) / 60


def _estimate(hours: Sequence[RollingHour]) -> Estimate:
    return Sample.of([each.mean_min for each in hours]).mean()


def cell(hours: Sequence[RollingHour]) -> str:
    """Mean minutes of all hours, and of each."""
    means = [each.mean_min for each in hours]
    return f"{mean(means):.0f} ({', '.join(f'{each:.0f}' for each in means)})"
