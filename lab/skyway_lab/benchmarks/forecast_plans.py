"""What a forecast costs: its factors for a drone model once, and then each plan of a booking.

`python -m skyway_lab forecast_plans [--stations 100 1000 10000] [--requests 20] [--hours 48]` plans
the same local requests in still air, as composition does without a forecast, and in the wind of a
forecast on a grid, which blows from another direction every hour.
"""

import argparse
import math
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np
from skyway_lab.benchmarks.planner.cell import Cell
from skyway_lab.benchmarks.planner.cities import SEED, city
from skyway_lab.benchmarks.planner.requests import requests
from skyway_lab.benchmarks.planner.table import Table

from skyway.delivery.plan import Plan
from skyway.network.network import Network
from skyway.planner import compose
from skyway.planner.airspace import Airspace
from skyway.planner.forecast import Forecast, planned_weather
from skyway.planner.hierarchy import Hierarchy
from skyway.planner.problem import Problem
from skyway.planner.wind import SegmentWind

#: Metres within which the destinations of a request lie, and its packages.
_REACH_M, _PACKAGES = 15_000.0, 2

#: The mean speed of the wind, metres per second, and the points of the grid.
_WIND_MPS, _GRID = 4.0, (10, 10)

#: A moment in 2026, seconds: forecasts begin at fleet times, and problems at 0.
_NOW_S: Final = 1_790_000_000.0

_ROUNDS: Final = 5


@dataclass(frozen=True, slots=True)
class _Prepared:
    """What composition keeps of a network."""

    airspace: Airspace
    hierarchy: Hierarchy


def turning_forecast(network: Network, *, hours: int) -> Forecast:
    """A forecast whose wind turns by some degrees every hour and differs from place to place."""
    columns, chance = network.columns, np.random.default_rng(SEED)
    axes = [
        np.linspace(at_deg.min() - 0.1, at_deg.max() + 0.1, count)
        for at_deg, count in zip((columns.latitude_deg, columns.longitude_deg), _GRID, strict=True)
    ]
    shape = (hours, _GRID[0] * _GRID[1])
    turned_rad = np.cumsum(chance.normal(0.0, 0.25, hours))[:, None]
    towards_rad = turned_rad + chance.normal(0.0, 0.1, shape)
    speed_mps = _WIND_MPS * chance.uniform(0.7, 1.3, shape)
    return Forecast(
        longitude_deg=np.tile(axes[1], _GRID[0]),
        latitude_deg=np.repeat(axes[0], _GRID[1]),
        edges_s=_NOW_S + 3_600.0 * np.arange(hours + 1, dtype=np.float64),
        east_mps=speed_mps * np.cos(towards_rad),
        north_mps=speed_mps * np.sin(towards_rad),
        gust_mps=1.5 * speed_mps,
        temperature_c=np.full(shape, 15.0),
        error_mps=np.full(shape, 0.5),
        grid=_GRID,
    )


def _least_ms(act: Callable[[], object]) -> float:
    """The least processor time of some rounds, milliseconds."""
    least_s = math.inf
    for _ in range(_ROUNDS):
        began_s = time.process_time()
        act()
        least_s = min(least_s, time.process_time() - began_s)
    return 1_000 * least_s


def _row(stations: int, *, runs: int, hours: int) -> tuple[str, ...]:
    network = city(stations)
    prepared = _Prepared(Airspace.of(network), Hierarchy.of(network))
    forecast = turning_forecast(network, hours=hours)
    cell = Cell(stations, _PACKAGES, reach_m=_REACH_M)
    problems = [*requests(network, cell, runs=runs, limit_s=20.0)]
    model = problems[0].drone.model
    began_s = time.process_time()
    wind = SegmentWind.of(network, forecast.field())
    wind_ms = 1_000 * (time.process_time() - began_s)
    weather = planned_weather(wind, model)
    made_ms = _least_ms(partial(planned_weather, wind, model))

    def still(problem: Problem) -> Plan:
        return compose(problem, airspace=prepared.airspace, hierarchy=prepared.hierarchy)

    def windy(problem: Problem) -> Plan:
        moved = weather.shifted(-_NOW_S - 1_800.0)
        in_weather = problem.model_copy(update={"weather": moved})
        return compose(in_weather, airspace=prepared.airspace, hierarchy=prepared.hierarchy)

    pairs = [
        (_least_ms(partial(still, each)), _least_ms(partial(windy, each))) for each in problems
    ]
    shift_ms = _least_ms(lambda: [weather.shifted(-_NOW_S) for _ in range(100)]) / 100
    return (
        f"{stations:,}",
        f"{len(network.columns.length_m):,}",
        f"{wind_ms:.0f} ms",
        f"{made_ms:.0f} ms",
        f"{1_000 * shift_ms:.0f} us",
        f"{statistics.median(each[0] for each in pairs):.2f} ms",
        f"{statistics.median(each[1] for each in pairs):.2f} ms",
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--stations", type=int, nargs="+", default=[100, 1_000, 10_000])
    parser.add_argument("--requests", type=int, default=20)
    parser.add_argument("--hours", type=int, default=48)
    given = parser.parse_args()
    table = Table(
        "forecast_plans",
        f"**Plans in a forecast** of {given.hours} hours, processor time; medians of "
        f"{given.requests} requests with {_PACKAGES} packages within {_REACH_M / 1_000:g} km.",
        ("stations", "segments", "wind", "a model", "shift", "plan, still", "plan, forecast"),
    )
    for stations in given.stations:
        table.rows.append(_row(stations, runs=given.requests, hours=given.hours))
    print(table.as_markdown())


if __name__ == "__main__":
    main()
