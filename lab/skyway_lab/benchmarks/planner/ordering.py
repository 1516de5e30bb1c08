"""Peers order the destinations by flight time; our planner plans the rest.

The planner keeps the peer's order and finds the best path, pads and recharging for it. Each result
is a true plan, and its delay is the price of the order alone.
"""

import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass

import numpy as np
import numpy.typing as npt
from skyway_lab.benchmarks.planner.cell import Cell
from skyway_lab.benchmarks.planner.cities import city
from skyway_lab.benchmarks.planner.congestion import Congestion, book
from skyway_lab.benchmarks.planner.distances import lengths_m
from skyway_lab.benchmarks.planner.distribution import Distribution
from skyway_lab.benchmarks.planner.extent import Extent
from skyway_lab.benchmarks.planner.lateness import Lateness
from skyway_lab.benchmarks.planner.peers.interface import OrderPeer
from skyway_lab.benchmarks.planner.peers.roster import label, missing, peers
from skyway_lab.benchmarks.planner.prepared import Prepared
from skyway_lab.benchmarks.planner.requests import requests, source_rows
from skyway_lab.benchmarks.planner.solving import solve
from skyway_lab.benchmarks.planner.speed import horizon_s
from skyway_lab.benchmarks.planner.table import Table

from skyway.drone.flight import flight_time_s
from skyway.ids import StationId
from skyway.network.network import Network
from skyway.planner.airspace import Airspace
from skyway.planner.exact import exact, exact_with
from skyway.planner.exact_task import Method
from skyway.planner.findings import Strategy
from skyway.planner.hierarchy import Hierarchy
from skyway.planner.problem import Problem
from skyway.planner.situation import Situation
from skyway.planner.stop import Effort, TimeLimit

_STATIONS = 1_000
_SOLVE_S = 10.0


@dataclass(frozen=True, slots=True)
class Ordered:
    """One competitor's times for one request, to order and then to plan, and its delivery time."""

    order_ms: float
    plan_ms: float
    delivered_s: float | None


def ordering(extent: Extent) -> Table:
    """Times, and how much later than the optimum the plans in the peers' orders are."""
    table = Table(
        "ordering",
        f"**Ordering peers**, {_STATIONS:,} stations, destinations over the whole network: median "
        "milliseconds to order, and to plan in that order; and how much later the plans are.",
        (
            "packages",
            "taken",
            "order by",
            "order",
            "plan",
            "later: mean",
            "p95",
            "worst",
            "optimal",
        ),
    )
    network = city(_STATIONS)
    hierarchy = Hierarchy.of(network)
    sources = source_rows(network, extent.ordering_runs)
    for taken in extent.ordering_taken:
        pads = book(network, Congestion(taken, horizon_s(_STATIONS, None)), sources=sources)
        prepared = Prepared(pads, Airspace.of(network), hierarchy)
        for packages in extent.packages:
            cell = Cell(_STATIONS, packages)
            _compare(table, cell, taken=taken, prepared=prepared, runs=extent.ordering_runs)
    table.remarks = [
        (
            f"{extent.ordering_runs} seeded runs a row. exact orders and plans in one search. The "
            "time to make the peers' matrix of flight times is not counted."
        ),
        *missing("order"),
    ]
    return table


def _compare(table: Table, cell: Cell, *, taken: float, prepared: Prepared, runs: int) -> None:
    problems = list(requests(city(cell.stations), cell, runs=runs, limit_s=_SOLVE_S))
    solve(problems[0], prepared)
    best = [_planned(exact, problem, prepared) for problem in problems]
    for name, results in (("exact", best), *_by_peers(problems, prepared)):
        order = Distribution.of([each.order_ms for each in results])
        plan = Distribution.of([each.plan_ms for each in results])
        late = Lateness.of(
            [each.delivered_s for each in results], [each.delivered_s for each in best]
        )
        ordered_in = "" if name == "exact" else f"{order.median_ms:.1f}"
        texts = (ordered_in, f"{plan.median_ms:.1f}", *late.as_texts())
        table.rows.append((str(cell.packages), f"{taken:.0%}", name, *texts))
        key = {"packages": cell.packages, "taken": taken, "name": name}
        table.numbers.append(
            {**key, "order": asdict(order), "plan": asdict(plan), "later": asdict(late)}
        )


def _by_peers(problems: list[Problem], prepared: Prepared) -> Iterator[tuple[str, list[Ordered]]]:
    matrices = [flight_ms(problem) for problem in problems]
    for peer in peers("order"):
        yield (
            label(peer.package),
            [
                _ordered_by(peer, problem, matrix, prepared)
                for problem, matrix in zip(problems, matrices, strict=True)
            ],
        )


def _ordered_by(
    peer: OrderPeer, problem: Problem, matrix: npt.NDArray[np.int64], prepared: Prepared
) -> Ordered:
    started = time.perf_counter()
    numbers = peer.order(matrix)
    order_ms = 1000 * (time.perf_counter() - started)
    order = [destinations_of(problem)[number - 1] for number in numbers]
    planned = _planned(exact_with(Method(), order=order), problem, prepared)
    return Ordered(order_ms, planned.plan_ms, planned.delivered_s)


def _planned(strategy: Strategy, problem: Problem, prepared: Prepared) -> Ordered:
    started = time.perf_counter()
    situation = Situation.of(
        problem, prepared.airspace, prepared.book, hierarchy=prepared.hierarchy
    )
    findings = strategy(situation, Effort(TimeLimit(_SOLVE_S)))
    elapsed_ms = 1000 * (time.perf_counter() - started)
    itinerary = findings.itinerary
    return Ordered(0.0, elapsed_ms, None if itinerary is None else itinerary.delivered_s)


def destinations_of(problem: Problem) -> list[StationId]:
    """The destinations in the order of the packages."""
    return [package.destination for package in problem.packages]


def flight_ms(problem: Problem) -> npt.NDArray[np.int64]:
    """Milliseconds of the shortest flights, ``(k + 1, k + 1)``; 0 is the source.

    The model flies as fast with packages as without.
    """
    network: Network = problem.network
    stops = [network.row_of[each] for each in (problem.source, *destinations_of(problem))]
    metres = lengths_m(network, stops)[:, stops]
    s_per_m = flight_time_s(problem.drone.model, length_m=1.0, load_kg=0.0)
    return np.rint(1000 * s_per_m * metres).astype(np.int64)
