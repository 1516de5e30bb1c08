"""`python -m skyway_lab planner`: measure, print the tables, keep the numbers."""

import argparse
import json
import shlex
import sys
import time
from collections.abc import Callable
from dataclasses import asdict
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

from skyway_lab.benchmarks.planner.charging import charging
from skyway_lab.benchmarks.planner.cities import SEED
from skyway_lab.benchmarks.planner.contestants import contestants
from skyway_lab.benchmarks.planner.energy import energy
from skyway_lab.benchmarks.planner.extent import FULL, SHORT, Extent
from skyway_lab.benchmarks.planner.machine import Machine
from skyway_lab.benchmarks.planner.ordering import ordering
from skyway_lab.benchmarks.planner.page import write_page
from skyway_lab.benchmarks.planner.reading import reading
from skyway_lab.benchmarks.planner.scarce import scarce
from skyway_lab.benchmarks.planner.shortest_paths import shortest_paths
from skyway_lab.benchmarks.planner.speed import local, unprepared, whole_network
from skyway_lab.benchmarks.planner.start import start
from skyway_lab.benchmarks.planner.table import Table
from skyway_lab.benchmarks.planner.trips import trips
from skyway_lab.benchmarks.planner.weather import weather


def main(arguments: list[str]) -> int:
    """Measure what is asked for; 0."""
    options = _parser().parse_args(arguments)
    extent = FULL if options.full else SHORT
    heading = _heading(arguments, Machine.here())
    print(heading, flush=True)
    tables = []
    for name, measure in _sections(extent).items():
        if options.only and name not in options.only:
            continue
        started = time.perf_counter()
        tables.append(measure())
        took_s = time.perf_counter() - started
        print(f"\n{tables[-1].as_markdown()}\n\n({took_s:.0f} s)", flush=True)
    if options.json:
        _append(options.json, heading, tables)
    if options.page:
        write_page(options.page, heading, tables)
    return 0


def _sections(extent: Extent) -> dict[str, Callable[[], Table]]:
    return {
        "whole-network": partial(whole_network, extent),
        "unprepared": partial(unprepared, extent),
        "local": partial(local, extent),
        "start": partial(start, extent),
        "contestants": partial(contestants, extent),
        "ordering": partial(ordering, extent),
        "charging": partial(charging, extent),
        "reading": reading,
        "shortest-paths": shortest_paths,
        "scarce": partial(scarce, extent),
        "trips": partial(trips, extent),
        "weather": partial(weather, extent),
        "energy": energy,
    }


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m skyway_lab planner", description=__doc__)
    parser.add_argument("--full", action="store_true", help="every cell, with more runs")
    parser.add_argument("--only", action="append", choices=list(_sections(SHORT)), help="a table")
    parser.add_argument("--json", type=Path, metavar="FILE", help="append the numbers, a line")
    parser.add_argument("--page", type=Path, metavar="FILE", help="write the tables into a page")
    return parser


def _heading(arguments: list[str], machine: Machine) -> str:
    command = shlex.join(["python", "-m", "skyway_lab", "planner", *arguments])
    return f"`{command}`, seed {SEED}, {datetime.now(UTC):%Y-%m-%d}: {machine.as_text()}."


def _append(path: Path, heading: str, tables: list[Table]) -> None:
    """One line of JSON: what was run, on what, and the numbers of every table."""
    record = {
        "measured_at": datetime.now(UTC).isoformat(timespec="seconds"),
        "heading": heading,
        "seed": SEED,
        "machine": asdict(Machine.here()),
        "tables": {table.name: asdict(table) for table in tables},
    }
    with path.open("a") as file:
        file.write(json.dumps(record, allow_nan=False) + "\n")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
