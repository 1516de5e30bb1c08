"""`python -m benchmarks dispatch`: the gain from planning all requests of a fleet together.

rolling: one hour of requests; each minute every policy plans the requests that have not started.
together: all requests of the hour are known when it begins; with a proven lower bound.

docs/dispatch.md says how the cases are drawn, and holds the results.
"""

import argparse
import shlex
import sys
from collections.abc import Iterator, Sequence
from statistics import mean

from benchmarks.dispatch.cases import FleetCase, fleet_case
from benchmarks.dispatch.policies import FIRST_COME, ORDER_SEARCH, ORTOOLS, POOLING, Policy
from benchmarks.dispatch.rolling import RollingHour, on_time_share
from benchmarks.planner.machine import Machine
from benchmarks.planner.table import Table
from skyway.dispatch.optimise import optimise
from skyway.dispatch.warm import warm
from skyway.experiments.fleet_hour.cases import Load, Place

CASES: Sequence[tuple[Place, Load]] = (
    ("city", Load(10, 50)),
    ("city", Load(25, 100)),
    ("corridor", Load(25, 100)),
    ("three hubs", Load(10, 50)),
    ("three hubs", Load(25, 100)),
)


def read_arguments(arguments: Sequence[str]) -> argparse.Namespace:
    """The sizes of a run."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks dispatch")
    parser.add_argument("--only", choices=("rolling", "together"), help="only this part")
    parser.add_argument("--case", type=int, action="append", help="only the case of this number")
    parser.add_argument("--seeds", type=int, default=3, help="seeds 1 to this")
    parser.add_argument("--minute-s", type=float, default=0.3, help="processor time a minute")
    parser.add_argument("--budget-s", type=float, default=10.0, help="processor time of a plan")
    return parser.parse_args(arguments)


def policies_of(place: Place) -> list[Policy]:
    """The policies that a case compares; only hubs have requests with one pick-up."""
    pooled = [POOLING] if place == "three hubs" else []
    return [FIRST_COME, ORDER_SEARCH, *pooled, ORTOOLS]


def rolling(sizes: argparse.Namespace) -> Iterator[Table]:
    """Mean minutes from each request to its last delivery, by case and policy."""
    for place, load in _chosen(sizes):
        table = Table(
            "rolling",
            f"{place}, {load}, {sizes.minute_s:g} s of processor time a minute",
            ("policy", "served", "mean, min", "by seed", "on time", "kWh"),
        )
        for policy in policies_of(place):
            hours = []
            for seed in range(1, sizes.seeds + 1):
                case = fleet_case(place, load, seed=seed)
                hours.append(RollingHour(case, policy, sizes.minute_s, seed))
                hours[-1].run()
            means = [hour.mean_min for hour in hours]
            table.rows.append(
                (
                    policy.name,
                    f"{mean(hour.served_share for hour in hours):.0%}",
                    f"{mean(means):.0f}",
                    ", ".join(f"{each:.0f}" for each in means),
                    f"{mean(on_time_share(hour) for hour in hours):.0%}",
                    f"{mean(hour.energy_j for hour in hours) / 3.6e6:.0f}",
                )
            )
        yield table


def together(sizes: argparse.Namespace) -> Iterator[Table]:
    """The same with all requests known when the hour begins, and what is proven."""
    for place, load in _chosen(sizes):
        table = Table(
            "together",
            f"{place}, {load}, all requests known together, {sizes.budget_s:g} s of processor "
            "time; mean minutes",
            ("case", "seed", "arrival order", "search", "proven", "gap", "OR-Tools' order"),
        )
        for pooling in (False, True) if place == "three hubs" else (False,):
            for seed in range(1, sizes.seeds + 1):
                case = fleet_case(place, load, seed=seed)
                name = "pooled" if pooling else "each alone"
                table.rows.append((name, *_of_one(case, seed, sizes.budget_s, pooling=pooling)))
        yield table


def _of_one(case: FleetCase, seed: int, budget_s: float, *, pooling: bool) -> tuple[str, ...]:
    problem = case.known_together(pooling=pooling)
    plan = optimise(problem, budget_s=budget_s, seed=seed, proves=True)
    per_request_min = 60 * len(problem.requests)
    bound_s = plan.lower_bound_s or 0.0
    routed = (
        ""
        if pooling
        else _minutes(ORTOOLS.plan(problem, budget_s, seed).costs.delivery_s, per_request_min)
    )
    return (
        str(seed),
        _minutes(plan.arrival_order.total_s, per_request_min),
        _minutes(plan.costs.total_s, per_request_min),
        _minutes(bound_s, per_request_min),
        f"{plan.gap:.0%}",
        routed,
    )


def _minutes(total_s: float, per_request_min: float) -> str:
    return f"{total_s / per_request_min:.1f}"


def _chosen(sizes: argparse.Namespace) -> list[tuple[Place, Load]]:
    return [
        each for number, each in enumerate(CASES) if number in (sizes.case or range(len(CASES)))
    ]


def main(arguments: list[str]) -> int:
    """Measure and print."""
    sizes = read_arguments(arguments)
    command = shlex.join(["python", "-m", "benchmarks", "dispatch", *arguments])
    print(f"`{command}`: {Machine.here().as_text()}.\n", flush=True)
    warm()
    for name, part in (("rolling", rolling), ("together", together)):
        if sizes.only in (None, name):
            for table in part(sizes):
                print(f"{table.as_markdown()}\n", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
