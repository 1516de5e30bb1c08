"""One table: the most that any plan could save, however late, beside the earliest plan."""

import statistics

from skyway_lab.benchmarks.planner.cell import Cell
from skyway_lab.benchmarks.planner.congestion import Congestion, book
from skyway_lab.benchmarks.planner.requests import requests
from skyway_lab.benchmarks.planner.table import Table

from skyway.delivery.plan import Plan, PlanStatus
from skyway.drone.charging import fastest_s_per_soc
from skyway.drone.flight import flight_energy_j
from skyway.network.synthetic import synthetic_city
from skyway.planner import compose
from skyway.planner.airspace import Airspace
from skyway.planner.matrix import SOURCE, orders_by_cost
from skyway.planner.pad_book import NO_RESERVATIONS
from skyway.planner.problem import Problem
from skyway.planner.situation import Situation
from skyway.planner.subnetwork import Subnetwork

_STATIONS = 150
_TAKEN = 0.9
_DAY_S = 86_400.0
_PACKAGES = (1, 3, 5, 8)
_NETWORKS = 40
_RUNS = 2
#: Share of the model's battery: a whole battery nearly crosses a city of this size.
_BATTERY = 0.25
_LIMIT_S = 20.0


def energy() -> Table:
    """The share of energy and of minutes on pads that the earliest plan uses above the least."""
    table = Table(
        "energy",
        f"**What a later plan could save**, {_STATIONS} stations, {_TAKEN:.0%} of the pads' time "
        "taken: at most so much less energy than the earliest plan, and so much less time on pads.",
        ("packages", "requests", "energy: mean", "p90", "worst", "on pads: mean", "p90", "worst"),
    )
    for packages in _PACKAGES:
        shares = [each for seed in range(1, _NETWORKS + 1) for each in saved(seed, packages)]
        columns = list(zip(*shares, strict=True))
        texts = [text for column in columns for text in _as_texts(sorted(column))]
        table.rows.append((str(packages), str(len(shares)), *texts))
        table.numbers.append(
            {"packages": packages, "mean": [statistics.mean(column) for column in columns]}
        )
    table.remarks = [
        (
            f"{_NETWORKS} seeded networks with {_RUNS} requests each, the drone with "
            f"{_BATTERY:.0%} of its battery; requests without a proven plan are left out."
        ),
        "The least energy: the best order along shortest paths, with every pad free.",
        "The least time on pads: this energy charged where charging is fastest.",
    ]
    return table


def saved(seed: int, packages: int) -> list[tuple[float, float]]:
    """For each request of a network the most that could be saved: of energy, of time on pads."""
    network = synthetic_city(stations=_STATIONS, seed=seed)
    airspace = Airspace.of(network)
    pads = book(network, Congestion(_TAKEN, _DAY_S), sources=[])
    shares = []
    cell = Cell(_STATIONS, packages)
    for request in requests(network, cell, runs=_RUNS, limit_s=_LIMIT_S):
        problem = _with_small_battery(request)
        plan = compose(problem, airspace=airspace, booked=pads)
        if plan.status is PlanStatus.OPTIMAL:
            shares.append(_shares(problem, plan, _least_j(problem, airspace)))
    return shares


def _with_small_battery(problem: Problem) -> Problem:
    model = problem.drone.model
    smaller = model.model_copy(update={"battery_j": _BATTERY * model.battery_j})
    drone = problem.drone.model_copy(update={"model": smaller})
    return problem.model_copy(update={"drone": drone})


def _least_j(problem: Problem, airspace: Airspace) -> float:
    """The least energy of any plan, joules: the best order along shortest paths."""
    situation = Situation.of(problem, airspace, NO_RESERVATIONS)
    model, destinations = situation.model, situation.destinations
    whole = Subnetwork.whole(situation)
    trees = [whole.lengths_to_m(target) for target in destinations]

    def leg_j(at: int, to: int, undelivered: int) -> float:
        start = problem.source if at == SOURCE else destinations[at]
        waiting = {each for n, each in enumerate(destinations) if undelivered >> n & 1}
        load_kg = situation.load_kg(waiting)
        return flight_energy_j(model, length_m=trees[to][start], load_kg=load_kg) + model.stop_j

    return next(orders_by_cost(len(destinations), leg_j))[0]


def _shares(problem: Problem, plan: Plan, least_j: float) -> tuple[float, float]:
    model = problem.drone.model
    energy_j, on_pads_s = plan.energy_j or 0.0, plan.recharging_s or 0.0
    on_board_j = (problem.drone.soc - model.reserve_soc) * model.battery_j
    least_s = max(0.0, least_j - on_board_j) / model.battery_j * fastest_s_per_soc(model)
    return 1.0 - least_j / energy_j, 1.0 - least_s / on_pads_s if on_pads_s > 0 else 0.0


def _as_texts(ranked: list[float]) -> tuple[str, str, str]:
    p90 = ranked[int(0.9 * (len(ranked) - 1))]
    return f"{statistics.mean(ranked):.1%}", f"{p90:.1%}", f"{ranked[-1]:.1%}"
