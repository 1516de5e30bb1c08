"""frvcpy inserts recharging into a given order; our planner solves the same task.

The task is the part of the problem that frvcpy can solve: packages without mass, so that a
flight's energy is fixed; all pads free; no condition on the charge at the end.
"""

import time
from dataclasses import asdict

import numpy as np
from skyway_lab.benchmarks.planner.cell import Cell
from skyway_lab.benchmarks.planner.cities import city
from skyway_lab.benchmarks.planner.distances import lengths_m
from skyway_lab.benchmarks.planner.distribution import Distribution
from skyway_lab.benchmarks.planner.extent import Extent
from skyway_lab.benchmarks.planner.ordering import destinations_of
from skyway_lab.benchmarks.planner.peers.interface import ChargingPeer, ChargingTask
from skyway_lab.benchmarks.planner.peers.roster import label, missing, peers
from skyway_lab.benchmarks.planner.requests import requests
from skyway_lab.benchmarks.planner.table import Table

from skyway.drone.flight import flight_energy_j, flight_time_s
from skyway.drone.model import DroneModel
from skyway.network.network import Network
from skyway.planner import compose
from skyway.planner.airspace import Airspace
from skyway.planner.exact import exact_with
from skyway.planner.exact_task import Method
from skyway.planner.problem import Problem
from skyway.planner.situation import Situation
from skyway.planner.stop import Effort, never

_PACKAGES = 5
_SOLVE_S = 60.0
#: Seconds by which two delivery times may differ and still be the same.
_EQUAL_S = 0.5


def charging(extent: Extent) -> Table:
    """Milliseconds, and whether both find the same delivery time."""
    table = Table(
        "charging",
        f"**Recharging in a given order** (the best plan's), {_PACKAGES} destinations, pads free, "
        "packages without mass: milliseconds, median / p95 / worst.",
        ("stations", "by", "time", "same delivery time"),
    )
    for stations, runs in extent.charging_runs:
        problems = _problems(city(stations), stations, runs)
        _ours(problems[0])
        ours = [_ours(problem) for problem in problems]
        _add(table, stations, "skyway", ours, ours)
        for peer in peers("charging"):
            theirs = [_theirs(peer, problem) for problem in problems]
            _add(table, stations, label(peer.package), theirs, ours)
    table.remarks = [
        (
            "frvcpy is given the matrices of the shortest paths' times and energies; making them "
            "is not counted. skyway works on the network itself."
        ),
        *missing("charging"),
    ]
    return table


def _add(
    table: Table,
    stations: int,
    name: str,
    results: list[tuple[float, float]],
    ours: list[tuple[float, float]],
) -> None:
    times = Distribution.of([time_ms for time_ms, _ in results])
    same = sum(
        abs(own_s - other_s) <= _EQUAL_S
        for (_, own_s), (_, other_s) in zip(results, ours, strict=True)
    )
    table.rows.append((f"{stations:,}", name, times.as_text(), f"{same} of {len(results)}"))
    table.numbers.append({"stations": stations, "name": name, "times": asdict(times), "same": same})


def _problems(network: Network, stations: int, runs: int) -> list[Problem]:
    """Requests whose packages weigh nothing, and come in the order of the best plan.

    In another order a peer may fly over a destination whose turn has not come. The peer would not
    deliver there, but our drone has to.
    """
    cell = Cell(stations, _PACKAGES)
    drawn = requests(network, cell, runs=runs, limit_s=_SOLVE_S)
    return [_in_best_order(_weightless(problem)) for problem in drawn]


def _weightless(problem: Problem) -> Problem:
    packages = [package.model_copy(update={"mass_kg": 0.0}) for package in problem.packages]
    return problem.model_copy(update={"packages": tuple(packages), "finish": "stay"})


def _in_best_order(problem: Problem) -> Problem:
    packages = {package.package_id: package for package in problem.packages}
    deliveries = compose(problem).deliveries
    in_order = [packages[delivery.package_id] for delivery in deliveries]
    return problem.model_copy(update={"packages": tuple(in_order)})


def _ours(problem: Problem) -> tuple[float, float]:
    """Milliseconds, and the delivery time in seconds."""
    started = time.perf_counter()
    situation = Situation.of(problem, Airspace.of(problem.network))
    strategy = exact_with(Method(), order=destinations_of(problem))
    itinerary = strategy(situation, Effort(never)).itinerary
    elapsed_ms = 1000 * (time.perf_counter() - started)
    return elapsed_ms, np.inf if itinerary is None else itinerary.delivered_s


def _theirs(peer: ChargingPeer, problem: Problem) -> tuple[float, float]:
    task = _task_of(problem)
    started = time.perf_counter()
    delivered_s = peer.delivery_time_s(task)
    return 1000 * (time.perf_counter() - started), delivered_s


def _task_of(problem: Problem) -> ChargingTask:
    """Stops first, then every station as a place to charge; a drone may charge at a stop too."""
    network, model = problem.network, problem.drone.model
    stations = len(network.columns.station_ids)
    stops = [network.row_of[each] for each in (problem.source, *destinations_of(problem))]
    rows = [*stops, *range(stations)]
    metres = lengths_m(network, range(stations))[np.ix_(rows, rows)]
    curve_s, curve_j = _curve_above_reserve(model)
    return ChargingTask(
        seconds=(metres * flight_time_s(model, length_m=1.0, load_kg=0.0)).tolist(),
        joules=(metres * flight_energy_j(model, length_m=1.0, load_kg=0.0)).tolist(),
        stops=range(len(stops)),
        stations=range(len(stops), len(rows)),
        capacity_j=curve_j[-1],
        curve_s=curve_s,
        curve_j=curve_j,
    )


def _curve_above_reserve(model: DroneModel) -> tuple[list[float], list[float]]:
    """Seconds and joules of the charge curve, both counted from the reserve on."""
    socs = np.array([point.soc for point in model.charge_curve])
    times_s = np.array([point.time_s for point in model.charge_curve])
    reserve_s = float(np.interp(model.reserve_soc, socs, times_s))
    is_above = socs > model.reserve_soc
    curve_s = [0.0, *(times_s[is_above] - reserve_s).tolist()]
    charged = (socs[is_above] - model.reserve_soc) * model.battery_j
    return curve_s, [0.0, *charged.tolist()]
