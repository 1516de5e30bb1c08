"""The paper's two contestants beside `exact`, on the same requests."""

from dataclasses import asdict

from skyway_lab.benchmarks.planner.cell import Cell
from skyway_lab.benchmarks.planner.cities import city
from skyway_lab.benchmarks.planner.congestion import Congestion, book
from skyway_lab.benchmarks.planner.extent import Extent
from skyway_lab.benchmarks.planner.lateness import Lateness
from skyway_lab.benchmarks.planner.prepared import Prepared
from skyway_lab.benchmarks.planner.requests import requests, source_rows
from skyway_lab.benchmarks.planner.solving import Limits, Solved, measured, solve_all
from skyway_lab.benchmarks.planner.speed import horizon_s
from skyway_lab.benchmarks.planner.table import Table

from skyway.planner.airspace import Airspace
from skyway.planner.hierarchy import Hierarchy

_TAKEN = 0.5
#: The largest network for each contestant: enumeration ends at the 35 stations of the paper.
_LARGEST = {"exact": 10_000, "heuristic": 10_000, "exhaustive": 35}
_STATIONS = (8, 35, 1_000, 10_000)


def contestants(extent: Extent) -> Table:
    """Times of all three strategies, and how much later than the optimum their plans deliver."""
    table = Table(
        "contestants",
        f"**The paper's contestants**, {_TAKEN:.0%} of the pads' time taken: milliseconds for the "
        "whole solve, median / p95 / worst, and how much later than the optimum the plans are.",
        ("stations", "packages", "strategy", "time", "later: mean", "p95", "worst", "optimal"),
    )
    limits = extent.contestant_limits
    for stations in _STATIONS:
        network = city(stations)
        pads = book(
            network,
            Congestion(_TAKEN, horizon_s(stations, None)),
            sources=source_rows(network, limits.runs),
        )
        prepared = Prepared(pads, Airspace.of(network), Hierarchy.of(network))
        for packages in extent.contestant_packages:
            _compare(table, Cell(stations, packages), prepared, limits)
    table.remarks = [
        (
            f"{limits.runs} seeded runs a cell, none longer than {limits.solve_s:g} s, a cell no "
            f"longer than {limits.cell_s:g} s; exhaustive enumerates simple paths and so "
            "is asked up to 35 stations."
        ),
        (
            "optimal: plans no later than the optimum, of the plans compared. A plan that a limit "
            "cut off is compared as it was."
        ),
    ]
    return table


def _compare(table: Table, cell: Cell, prepared: Prepared, limits: Limits) -> None:
    best: list[Solved] = []
    for strategy, largest in _LARGEST.items():
        if cell.stations > largest:
            continue
        problems = requests(
            city(cell.stations), cell, runs=limits.runs, limit_s=limits.solve_s, strategy=strategy
        )
        solved = solve_all(problems, prepared, limits=limits)
        best = best or solved
        late = Lateness.of(
            [each.plan.delivery_time_s for each in solved],
            [each.plan.delivery_time_s for each in best],
        )
        cell_measured = measured(solved, prepared, limits=limits)
        names = (f"{cell.stations:,}", str(cell.packages), strategy)
        table.rows.append((*names, cell_measured.times.as_text(), *late.as_texts()))
        key = {"stations": cell.stations, "packages": cell.packages, "strategy": strategy}
        table.numbers.append({**key, **asdict(cell_measured), "later": asdict(late)})
