"""What idle drones bring to requests that wait: the rolling hour with and without them.

A new request may get each drone, as a booking does. Without idle drones, a request that has a plan
only gets drones that fly, or that have a trip in the plan.
"""

from collections.abc import Iterator, Sequence
from statistics import mean
from typing import Final

from skyway_lab.benchmarks.planner.table import Table
from skyway_lab.experiments.dispatched_hour.cases import PREPARE_S, fleet_case
from skyway_lab.experiments.dispatched_hour.policies import DispatchPolicy, searched_in_rounds
from skyway_lab.experiments.dispatched_hour.rolling import RollingHour
from skyway_lab.experiments.fleet_hour.cases import Load, Place

from skyway.dispatch.problem import FleetProblem
from skyway.dispatch.schedule import Schedule

_ALL_DRONES: Final = searched_in_rounds(2, most_steps=8_000)


def idle_drones(cases: Sequence[tuple[Place, Load]], *, seeds: Sequence[int]) -> Iterator[Table]:
    """Mean minutes from each request to its last delivery."""
    table = Table(
        "idle-drones",
        "promises 10 min wide, firm after 1 min",
        ("case", "only drones with missions", "idle drones too"),
    )
    for place, load in cases:
        row = []
        for plan in (_drones_with_missions, _ALL_DRONES):
            policy = DispatchPolicy(
                "order search", plan, promise_tolerance_s=600.0, firm_within_s=60.0
            )
            hours = [
                RollingHour(fleet_case(place, load, seed=each), policy, each) for each in seeds
            ]
            for hour in hours:
                hour.run()
            means = [hour.mean_min for hour in hours]
            row.append(f"{mean(means):.1f} ({', '.join(f'{each:.1f}' for each in means)})")
        table.rows.append((f"{place}, {load}", *row))
    yield table


def _drones_with_missions(problem: FleetProblem, seed: int) -> Schedule:
    """The search in which requests that have a plan get no idle drone."""
    planned = {each.planned.drone_id for each in problem.requests if each.planned is not None}
    drones = tuple(
        each.model_copy(
            update={
                "provider_id": "busy"
                if each.drone_id in planned or each.free_s > PREPARE_S
                else "idle"
            }
        )
        for each in problem.drones
    )
    requests = tuple(
        each if each.planned is None else each.model_copy(update={"provider_ids": ("busy",)})
        for each in problem.requests
    )
    limited = problem.model_copy(update={"drones": drones, "requests": requests})
    return _ALL_DRONES(limited, seed)
