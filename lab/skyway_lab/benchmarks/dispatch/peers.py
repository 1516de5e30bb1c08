"""Other routing solvers that order the trips; our exact planner plans the trips in their order."""

from collections.abc import Mapping
from importlib import import_module
from types import MappingProxyType
from typing import Final, Protocol

from skyway_lab.benchmarks.dispatch.routing_task import RoutingTask

from skyway.dispatch.problem import FleetProblem
from skyway.dispatch.schedule import Schedule, Scheduler, Sequences


class Order(Protocol):
    """Orders the trips of a task within a budget of processor time, if the solver can."""

    def __call__(self, task: RoutingTask, *, budget_s: float, seed: int) -> Sequences:
        """The sequences of the drones."""


#: The name of each solver, and the file and the function that call it.
_ROSTER: Final = (
    ("OR-Tools", "ortools_order", "ordered_by_ortools"),
    ("PyVRP", "pyvrp_order", "ordered_by_pyvrp"),
    ("VROOM", "vroom_order", "ordered_by_vroom"),
)


def present_peers() -> Mapping[str, Order]:
    """The solvers that are installed, by name."""
    found: dict[str, Order] = {}
    for name, file, function in _ROSTER:
        try:
            module = import_module(f"skyway_lab.benchmarks.dispatch.{file}")
        except ImportError:
            continue
        found[name] = getattr(module, function)
    return MappingProxyType(found)


def planned_in_order(
    problem: FleetProblem, order: Order, *, budget_s: float, seed: int
) -> Schedule:
    """The exact plans of the trips in the solver's order."""
    scheduler = Scheduler(problem)
    task = RoutingTask.of(problem, scheduler.estimates)
    if not problem.requests:
        return scheduler.arrival_order()
    return scheduler.planned(order(task, budget_s=budget_s, seed=seed))
