"""One table: the same requests in still air and in a wind that turns from hour to hour."""

import math
import statistics
import time

import numpy as np
from skyway_lab.benchmarks.planner.cell import LOCAL_REACH_M, Cell
from skyway_lab.benchmarks.planner.cities import SEED, city
from skyway_lab.benchmarks.planner.congestion import Congestion, book
from skyway_lab.benchmarks.planner.extent import Extent
from skyway_lab.benchmarks.planner.prepared import Prepared
from skyway_lab.benchmarks.planner.requests import requests, source_rows
from skyway_lab.benchmarks.planner.table import Table

from skyway.delivery.plan import Plan
from skyway.drone.models import DJI_MATRICE_300_RTK
from skyway.network.network import Network
from skyway.planner import compose
from skyway.planner.airspace import Airspace
from skyway.planner.problem import Problem
from skyway.planner.weather import Weather

_HOUR_S = 3_600.0
_HOURS = 24
#: Metres per second on average; by chance a fifth more or less, and 0.25 rad of turn an hour.
_WIND_MPS = 4.0
_TAKEN = 0.5
_CELLS = (
    Cell(1_000, 1, reach_m=15_000.0),
    Cell(1_000, 3, reach_m=15_000.0),
    Cell(10_000, 3, reach_m=15_000.0),
    Cell(10_000, 3, reach_m=LOCAL_REACH_M),
    Cell(10_000, 8, reach_m=LOCAL_REACH_M),
    Cell(1_000, 5),
)
_RUNS = 8
_ROUNDS = 5
_LIMIT_S = 20.0


def weather(_extent: Extent) -> Table:
    """Processor time of one request in still air and in weather, in turns."""
    table = Table(
        "weather",
        f"**Weather**: processor milliseconds of one request, in still air and in a wind of "
        f"{_WIND_MPS:g} m/s over {_HOURS} hours that turns from hour to hour; medians.",
        ("stations", "packages", "within", "plan", "still", "weather", "ratio", "labels"),
    )
    for cell in _CELLS:
        table.rows.append(_row(cell))
    table.remarks = [
        f"{_RUNS} seeded requests a row, {_TAKEN:.0%} of the pads' time taken.",
        f"The least of {_ROUNDS} times each, measured in turns.",
        "plan: hours until the last delivery. labels: mean in still air, and in weather.",
        "Each segment has a factor for each hour, rounded up to 0.01. No network has a hierarchy.",
    ]
    return table


def _row(cell: Cell) -> tuple[str, ...]:
    network = city(cell.stations)
    pads = book(network, Congestion(_TAKEN, 24 * _HOUR_S), sources=source_rows(network, _RUNS))
    prepared = Prepared(pads, Airspace.of(network))
    windy = turning_wind(network)
    still_ms, windy_ms, ratios, plans = [], [], [], []
    for still in requests(network, cell, runs=_RUNS, limit_s=_LIMIT_S):
        pair = still, still.model_copy(update={"weather": windy})
        least_ms = [math.inf, math.inf]
        for _ in range(_ROUNDS):
            for number, problem in enumerate(pair):
                took_ms, plan = _planned(problem, prepared)
                least_ms[number] = min(least_ms[number], took_ms)
                plans.append((number, plan))
        still_ms.append(least_ms[0])
        windy_ms.append(least_ms[1])
        ratios.append(least_ms[1] / least_ms[0])
    labels = [
        statistics.mean(float(plan.stats["labels"]) for of, plan in plans if of == number)
        for number in range(2)
    ]
    hours = statistics.mean((plan.delivery_time_s or 0.0) / _HOUR_S for _, plan in plans)
    return (
        f"{cell.stations:,}",
        str(cell.packages),
        "the network" if cell.reach_m is None else f"{cell.reach_m / 1000:g} km",
        f"{hours:.1f} h",
        f"{statistics.median(still_ms):.1f}",
        f"{statistics.median(windy_ms):.1f}",
        f"{statistics.median(ratios):.2f}",
        f"{labels[0]:,.0f}, {labels[1]:,.0f}",
    )


def _planned(problem: Problem, prepared: Prepared) -> tuple[float, Plan]:
    started_s = time.process_time()
    plan = compose(problem, airspace=prepared.airspace, booked=prepared.book)
    return 1000 * (time.process_time() - started_s), plan


def turning_wind(network: Network) -> Weather:
    """The weather of this wind for all segments; drones hold their course against it."""
    columns, chance = network.columns, np.random.default_rng(SEED)
    stretch = math.cos(math.radians(float(columns.latitude_deg.mean())))
    east = (columns.longitude_deg[columns.to_row] - columns.longitude_deg[columns.from_row]) * (
        stretch
    )
    north = columns.latitude_deg[columns.to_row] - columns.latitude_deg[columns.from_row]
    length = np.hypot(east, north)
    east, north = east / length, north / length
    airspeed_mps = DJI_MATRICE_300_RTK.speed_full_mps
    direction_rad = chance.uniform(0.0, 2.0 * math.pi)
    time_factor = np.empty((_HOURS, len(length)))
    for hour in range(_HOURS):
        direction_rad += chance.normal(0.0, 0.25)
        wind_mps = _WIND_MPS * max(0.2, 1.0 + chance.normal(0.0, 0.2))
        to_east, to_north = wind_mps * math.cos(direction_rad), wind_mps * math.sin(direction_rad)
        along_mps = to_east * east + to_north * north
        across_mps = to_east * north - to_north * east
        ground_mps = np.sqrt(airspeed_mps**2 - across_mps**2) + along_mps
        time_factor[hour] = np.ceil(100.0 * airspeed_mps / ground_mps) / 100.0
    return Weather(
        network,
        np.arange(len(length)),
        _HOUR_S * np.arange(_HOURS + 1, dtype=np.float64),
        time_factor,
        np.ones_like(time_factor),
    )
