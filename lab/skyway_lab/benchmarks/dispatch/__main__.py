"""`python -m skyway_lab dispatch`: the gain from planning all requests of a fleet together.

rolling: one hour of requests; each minute every policy plans the requests that have not started.
together: all requests of the hour are known when it begins; with a proven lower bound.
published: a published instance with few chargers, solved in the same way.
standbys: where idle drones wait, without a search.
small: random fleets of two drones, beside every order.
promises: the mean of the rolling hour by when a promise is firm, and by its width.
providers: three fleets of three drones, each searched alone or all searched together.
windows: the rolling hour in which a third of the requests have a window.
batches: the rolling hour in which requests wait a few seconds to be planned together.
idle: the rolling hour in which requests that wait get no idle drones, or get them too.

docs/dispatch.md says how the cases are drawn, and holds the results.
"""

import argparse
import shlex
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from statistics import mean
from types import MappingProxyType

from skyway_lab.benchmarks.dispatch.idle_drones import idle_drones
from skyway_lab.benchmarks.dispatch.peers import Order, planned_in_order, present_peers
from skyway_lab.benchmarks.dispatch.promises import ROUNDS, promises
from skyway_lab.benchmarks.dispatch.providers import providers
from skyway_lab.benchmarks.dispatch.published import published_fleet
from skyway_lab.benchmarks.dispatch.small import small
from skyway_lab.benchmarks.dispatch.standbys import standbys
from skyway_lab.benchmarks.dispatch.windows import batches, windows
from skyway_lab.benchmarks.planner.machine import Machine
from skyway_lab.benchmarks.planner.table import Table
from skyway_lab.experiments.dispatched_hour.cases import fleet_case
from skyway_lab.experiments.dispatched_hour.policies import (
    FIRST_COME,
    DispatchPolicy,
    searched_for,
    searches,
)
from skyway_lab.experiments.dispatched_hour.rolling import RollingHour, on_time_share
from skyway_lab.experiments.fleet_hour.cases import Load, Place

from skyway.dispatch.optimise import optimise
from skyway.dispatch.problem import FleetProblem
from skyway.dispatch.schedule import Schedule
from skyway.dispatch.warm import warm

CASES: Sequence[tuple[Place, Load]] = (
    ("city", Load(10, 50)),
    ("city", Load(25, 100)),
    ("corridor", Load(25, 100)),
    ("three hubs", Load(10, 50)),
    ("three hubs", Load(25, 100)),
)


def read_arguments(arguments: Sequence[str]) -> argparse.Namespace:
    """The sizes of a run."""
    parser = argparse.ArgumentParser(prog="python -m skyway_lab dispatch")
    parser.add_argument("--only", choices=tuple(PARTS), help="only this part")
    parser.add_argument("--case", type=int, action="append", help="only the case of this number")
    parser.add_argument("--seeds", type=int, default=3, help="seeds 1 to this")
    parser.add_argument(
        "--first-seed", type=int, default=1, help="the first seed of the hours with promises"
    )
    parser.add_argument(
        "--rounds", type=int, default=ROUNDS, help="rounds of a plan in the hours with promises"
    )
    parser.add_argument("--minute-s", type=float, default=0.3, help="processor time a minute")
    parser.add_argument("--fleets", type=int, default=200, help="small random fleets")
    parser.add_argument("--budget-s", type=float, default=10.0, help="processor time of a plan")
    parser.add_argument("--figure", type=Path, help="a file for the figure of the promises")
    parser.add_argument(
        "--no-bound", action="store_true", help="prove nothing; a proof takes a minute a plan"
    )
    return parser.parse_args(arguments)


def policies_of(place: Place, minute_s: float) -> list[DispatchPolicy]:
    """The policies that a case compares; only hubs have requests with one pickup."""
    own = searches(searched_for(minute_s))
    found = [FIRST_COME, *(each for each in own if place == "three hubs" or not each.pooling)]
    found += [_in_order(name, order, minute_s) for name, order in present_peers().items()]
    return found


def _in_order(name: str, order: Order, budget_s: float) -> DispatchPolicy:
    def plan(problem: FleetProblem, seed: int) -> Schedule:
        return planned_in_order(problem, order, budget_s=budget_s, seed=seed)

    return DispatchPolicy(f"{name}'s order", plan)


def rolling(sizes: argparse.Namespace) -> Iterator[Table]:
    """Mean minutes from each request to its last delivery, by case and policy."""
    for place, load in _chosen(sizes):
        table = Table(
            "rolling",
            f"{place}, {load}, {sizes.minute_s:g} s of processor time a minute",
            ("policy", "served", "mean, min", "by seed", "on time", "kWh"),
        )
        for policy in policies_of(place, sizes.minute_s):
            hours = []
            for seed in range(1, sizes.seeds + 1):
                hours.append(RollingHour(fleet_case(place, load, seed=seed), policy, seed))
                hours[-1].run()
            means = [hour.mean_min for hour in hours]
            table.rows.append(
                (
                    policy.name,
                    f"{mean(hour.served_share for hour in hours):.0%}",
                    f"{mean(means):.0f}",
                    ", ".join(f"{each:.0f}" for each in means),
                    f"{mean(on_time_share(hour.case, hour.waited_s()) for hour in hours):.0%}",
                    f"{mean(hour.energy_j for hour in hours) / 3.6e6:.0f}",
                )
            )
        yield table


def together(sizes: argparse.Namespace) -> Iterator[Table]:
    """The same with all requests known when the hour begins, and what is proven."""
    for place, load in _chosen(sizes):
        table = _table(f"{place}, {load}, all requests known together", sizes)
        for seed in range(1, sizes.seeds + 1):
            case = fleet_case(place, load, seed=seed)
            for pooling in (False, True) if place == "three hubs" else (False,):
                problem = case.known_together(pooling=pooling)
                table.rows.append(_row(problem, seed, sizes, pooling=pooling))
        yield table


def published(sizes: argparse.Namespace) -> Iterator[Table]:
    """The same for a published instance."""
    table = _table("tc0c40s8cf0 of Montoya et al. 2017, 10 vehicles, 1 pad a station", sizes)
    for pooling in (False, True):
        problem = published_fleet(pooling=pooling)
        table.rows.append(_row(problem, 1, sizes, pooling=pooling))
    yield table


PARTS: Mapping[str, Callable[[argparse.Namespace], Iterator[Table]]] = MappingProxyType(
    {
        "rolling": rolling,
        "together": together,
        "published": published,
        "standbys": lambda sizes: standbys(seeds=sizes.seeds),
        "promises": lambda sizes: promises(
            _chosen(sizes), seeds=_seeds(sizes), rounds=sizes.rounds, figure=sizes.figure
        ),
        "providers": lambda sizes: providers(seeds=sizes.seeds),
        "windows": lambda sizes: windows(seeds=_seeds(sizes)),
        "batches": lambda sizes: batches(_chosen(sizes), seeds=_seeds(sizes)),
        "idle": lambda sizes: idle_drones(_chosen(sizes), seeds=_seeds(sizes)),
        "small": lambda sizes: small(sizes.fleets, budget_s=sizes.minute_s),
    }
)


def _table(title: str, sizes: argparse.Namespace) -> Table:
    orders = [f"{name}'s order" for name in present_peers()]
    return Table(
        "together",
        f"{title}, {sizes.budget_s:g} s of processor time; mean minutes",
        ("trips", "seed", "arrival order", "search", "proven", "gap", *orders),
    )


def _row(
    problem: FleetProblem, seed: int, sizes: argparse.Namespace, *, pooling: bool
) -> tuple[str, ...]:
    """One plan of each kind. The other solvers let no requests share a trip."""
    budget_s = sizes.budget_s
    plan = optimise(problem, budget_s=budget_s, seed=seed, proves=not sizes.no_bound)
    peers = {} if pooling else present_peers()
    ordered = [
        planned_in_order(problem, order, budget_s=budget_s, seed=seed) for order in peers.values()
    ]

    def minutes(total_s: float) -> str:
        return f"{total_s / (60 * len(problem.requests)):.1f}"

    return (
        "shared" if pooling else "of one request",
        str(seed),
        minutes(plan.arrival_order.total_s),
        minutes(plan.costs.total_s),
        "" if plan.lower_bound_s is None else minutes(plan.lower_bound_s),
        "" if plan.gap is None else f"{plan.gap:.0%}",
        *(minutes(each.costs.total_s) for each in ordered),
        *[""] * (len(present_peers()) - len(ordered)),
    )


def _seeds(sizes: argparse.Namespace) -> range:
    return range(sizes.first_seed, sizes.seeds + 1)


def _chosen(sizes: argparse.Namespace) -> list[tuple[Place, Load]]:
    return [
        each for number, each in enumerate(CASES) if number in (sizes.case or range(len(CASES)))
    ]


def main(arguments: list[str]) -> int:
    """Measure and print."""
    sizes = read_arguments(arguments)
    command = shlex.join(["python", "-m", "skyway_lab", "dispatch", *arguments])
    print(f"`{command}`: {Machine.here().as_text()}.\n", flush=True)
    warm()
    for name, part in PARTS.items():
        if sizes.only in (None, name):
            for table in part(sizes):
                print(f"{table.as_markdown()}\n", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
