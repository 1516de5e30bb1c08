"""One table: requests where nearly all pads are taken, proven, and cut off after some labels."""

import time

from skyway_lab.benchmarks.planner.cell import Cell
from skyway_lab.benchmarks.planner.cities import city
from skyway_lab.benchmarks.planner.congestion import Congestion, book
from skyway_lab.benchmarks.planner.distribution import Distribution
from skyway_lab.benchmarks.planner.extent import Extent
from skyway_lab.benchmarks.planner.lateness import Lateness
from skyway_lab.benchmarks.planner.prepared import Prepared
from skyway_lab.benchmarks.planner.requests import requests, source_rows
from skyway_lab.benchmarks.planner.solving import Solved, solve
from skyway_lab.benchmarks.planner.table import Table

from skyway.delivery.plan import PlanStatus
from skyway.planner.airspace import Airspace
from skyway.planner.problem import Problem

_DAY_S = 86_400.0
_CELLS = (
    Cell(35, 8),
    Cell(35, 12),
    Cell(1_000, 3),
    Cell(1_000, 8),
    Cell(1_000, 8, "full"),
    Cell(1_000, 12, "full"),
)
_SHARES = {"partial": (0.9, 0.95), "full": (0.7,)}
#: Seconds after which the search for a request ends; in other tables it ends sooner.
_LIMIT_S = 60.0
#: A limit under which a plan is compared with the best one.
_FEW_LABELS = 20_000


def scarce(extent: Extent) -> Table:
    """Requests over the whole network, by the share of pad time taken."""
    table = Table(
        "scarce",
        "**Where pads are scarce**: requests over the whole network, milliseconds of one core "
        "until the proof, median / p95 / worst; and how much later a plan is that is cut off after "
        f"{_FEW_LABELS:,} labels.",
        ("stations", "packages", "recharge", "taken", "time", "labels", "late: mean", "worst"),
    )
    for cell in _CELLS:
        for taken in _SHARES[cell.policy]:
            solved, cut_off = _solved(cell, taken, extent)
            finished = [one.elapsed_ms for one in solved if one.plan.status is PlanStatus.OPTIMAL]
            times = Distribution.of(
                finished, cut_off=len(solved) - len(finished), asked=len(solved)
            )
            labels = sum(float(one.plan.stats["labels"]) for one in solved) / len(solved)
            late = Lateness.of(
                [one.plan.delivery_time_s for one in cut_off],
                [one.plan.delivery_time_s for one in solved],
            )
            mean, _, worst, _ = late.as_texts()
            table.rows.append(
                (
                    f"{cell.stations:,}",
                    str(cell.packages),
                    cell.policy,
                    f"{taken:.0%}",
                    times.as_text(),
                    f"{labels:,.0f}",
                    mean,
                    worst,
                )
            )
            table.numbers.append({"cell": str(cell), "taken": taken, "median": times.median_ms})
    table.remarks = [
        f"{extent.scarce_runs} seeded runs a cell, none solved longer than {_LIMIT_S:g} s.",
        "Pads are taken for the first 24 h, and free afterwards. No network has a hierarchy.",
    ]
    return table


def _solved(cell: Cell, taken: float, extent: Extent) -> tuple[list[Solved], list[Solved]]:
    """The requests of a cell solved, and cut off."""
    runs, network = extent.scarce_runs, city(cell.stations)
    pads = book(network, Congestion(taken, _DAY_S), sources=source_rows(network, runs))
    prepared = Prepared(pads, Airspace.of(network))
    problems = list(requests(network, cell, runs=runs, limit_s=_LIMIT_S))
    few = [one.model_copy(update={"label_limit": _FEW_LABELS}) for one in problems]
    # Not counted: that the compiled code is loaded when it is first asked for.
    solve(few[0], prepared)
    return [_solve(one, prepared) for one in problems], [_solve(one, prepared) for one in few]


def _solve(problem: Problem, prepared: Prepared) -> Solved:
    """The request planned; its time is that of the processor, so other programs do not count."""
    started = time.thread_time()
    plan = solve(problem, prepared).plan
    return Solved(problem, 1000 * (time.thread_time() - started), plan)
