"""What promises cost in the rolling hour, by when they are firm and by their width."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from statistics import mean
from typing import Final

from skyway_lab.benchmarks.planner.table import Table
from skyway_lab.experiments.dispatched_hour.cases import fleet_case
from skyway_lab.experiments.dispatched_hour.policies import (
    DispatchPolicy,
    searched_in_rounds,
    searches,
)
from skyway_lab.experiments.dispatched_hour.rolling import RollingHour
from skyway_lab.experiments.figures import Axis, Line, draw_lines
from skyway_lab.experiments.fleet_hour.cases import Load, Place
from skyway_lab.experiments.sample import Sample

#: Minutes until a promise is firm, and its width in minutes.
_FIRM_MIN: Final = (1, 10, 30)
_WIDTHS_MIN: Final = (1, 10, 30)

#: The search of `live_hour`, in which each request flies alone, and the same with shared trips.
_ALONE, _POOLING, _ = searches(searched_in_rounds(2, most_steps=8_000))


def promises(
    cases: Sequence[tuple[Place, Load]], *, seeds: int, figure: Path | None
) -> Iterator[Table]:
    """Mean minutes from each request to its last delivery, a table for each case."""
    lines = []
    for place, load in cases:
        own = _POOLING if place == "three hubs" else _ALONE
        table = Table(
            "promises",
            f"{place}, {load}: firm after so many minutes",
            ("firm", *(f"{width} min wide" for width in _WIDTHS_MIN)),
        )
        for firm in _FIRM_MIN:
            found = [
                _means(place, load, seeds, _promising(own, firm_min=firm, width_min=width))
                for width in _WIDTHS_MIN
            ]
            table.rows.append((f"{firm} min", *map(_cell, found)))
            means = [Sample.of(each).mean() for each in found]
            lines.append(Line(f"{place}, firm after {firm} min", _WIDTHS_MIN, means))
        table.rows.append(
            ("no promise", *[_cell(_means(place, load, seeds, own))] * len(_WIDTHS_MIN))
        )
        yield table
    if figure is not None:
        width, minutes = (
            Axis("width of the promise, min"),
            Axis("mean minutes to the last delivery"),
        )
        draw_lines(figure, "What promises cost", x=width, y=minutes, lines=lines)


def _promising(policy: DispatchPolicy, *, firm_min: float, width_min: float) -> DispatchPolicy:
    return replace(policy, firm_within_s=60.0 * firm_min, promise_tolerance_s=60.0 * width_min)


def _means(place: Place, load: Load, seeds: int, policy: DispatchPolicy) -> list[float]:
    """The mean minutes of each seed."""
    hours = [
        RollingHour(fleet_case(place, load, seed=seed), policy, seed)
        for seed in range(1, seeds + 1)
    ]
    for hour in hours:
        hour.run()
    return [hour.mean_min for hour in hours]


def _cell(means: Sequence[float]) -> str:
    return f"{mean(means):.0f} ({', '.join(f'{each:.0f}' for each in means)})"
