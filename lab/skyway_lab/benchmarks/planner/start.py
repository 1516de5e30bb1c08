"""The first and the tenth plan after start: a fresh process warms up as a service does, and plans.

Run as a program it is that process and prints what it measured as JSON.
"""

import json
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from typing import TypeVar

from skyway_lab.benchmarks.planner.distribution import milliseconds
from skyway_lab.benchmarks.planner.extent import Extent
from skyway_lab.benchmarks.planner.table import Table

_PLANS = 10
_STATIONS = 10_000
_PACKAGES = 5
_TAKEN = 0.5
_WARM_UP_STATIONS = 10

_Answer = TypeVar("_Answer")


def start(extent: Extent) -> Table:
    """Milliseconds of each, the median of so many processes."""
    measured = [_start_process() for _ in range(extent.starts)]
    table = Table(
        "start",
        f"**After start**: the same local request ({_STATIONS:,} stations, {_PACKAGES} packages, "
        f"{_TAKEN:.0%} taken) planned {_PLANS} times in a fresh process; milliseconds.",
        ("warm-up", "network prepared", "first plan", "second", "tenth"),
    )
    medians = {key: statistics.median(run[key] for run in measured) for key in measured[0]}
    table.rows.append(tuple(milliseconds(value) for value in medians.values()))
    table.numbers = [dict(run) for run in measured]
    table.remarks = [
        (
            f"Median of {extent.starts} processes. Warming up is one small plan; compiled code is "
            "kept on disk from one process to the next."
        ),
    ]
    return table


def _start_process() -> dict[str, float]:
    command = [sys.executable, "-m", "skyway_lab.benchmarks.planner.start"]
    printed = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    measured: dict[str, float] = json.loads(printed)
    return measured


def _measure() -> dict[str, float]:
    # Imported here: the process that starts this one needs none of it.
    from skyway_lab.benchmarks.planner.cell import LOCAL_REACH_M, Cell
    from skyway_lab.benchmarks.planner.cities import city
    from skyway_lab.benchmarks.planner.congestion import Congestion, book
    from skyway_lab.benchmarks.planner.prepared import Prepared
    from skyway_lab.benchmarks.planner.requests import requests, source_rows
    from skyway_lab.benchmarks.planner.solving import solve
    from skyway_lab.benchmarks.planner.speed import horizon_s

    from skyway.planner.airspace import Airspace
    from skyway.planner.pad_book import NO_RESERVATIONS

    cell = Cell(_WARM_UP_STATIONS, 1)
    (small,) = requests(city(_WARM_UP_STATIONS), cell, runs=1, limit_s=60.0)
    idle = Prepared(NO_RESERVATIONS, Airspace.of(small.network))
    warm_up_ms, _ = _timed(lambda: solve(small, idle))

    network = city(_STATIONS)
    cell = Cell(_STATIONS, _PACKAGES, reach_m=LOCAL_REACH_M)
    (problem,) = requests(network, cell, runs=1, limit_s=60.0)
    congestion = Congestion(_TAKEN, horizon_s(_STATIONS, LOCAL_REACH_M))
    pads = book(network, congestion, sources=source_rows(network, 1))
    prepared_ms, _ = _timed(lambda: (network.incoming, network.outgoing))
    prepared = Prepared(pads, Airspace.of(network))
    times_ms = [solve(problem, prepared).elapsed_ms for _ in range(_PLANS)]
    return {
        "warm_up_ms": warm_up_ms,
        "prepared_ms": prepared_ms,
        "first_ms": times_ms[0],
        "second_ms": times_ms[1],
        "tenth_ms": times_ms[-1],
    }


def _timed(call: Callable[[], _Answer]) -> tuple[float, _Answer]:
    started = time.perf_counter()
    answer = call()
    return 1000 * (time.perf_counter() - started), answer


if __name__ == "__main__":
    sys.stdout.write(json.dumps(_measure()))
