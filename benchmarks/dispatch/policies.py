"""The policies: a fleet problem in, a schedule out, within a budget of processor time."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from benchmarks.dispatch.routing_order import ordered_by_ortools
from skyway.dispatch.optimise import searched
from skyway.dispatch.problem import FleetProblem
from skyway.dispatch.schedule import Schedule, Scheduler

#: A problem, the budget in seconds of processor time, and a seed.
Plan = Callable[[FleetProblem, float, int], Schedule]


@dataclass(frozen=True, slots=True)
class Policy:
    """How the open requests of a fleet are planned; `pooling` when they may share trips."""

    name: str
    plan: Plan
    pooling: bool = False


def _first_come(problem: FleetProblem, _budget_s: float, _seed: int) -> Schedule:
    """The current plan, and new requests booked behind it as they came."""
    scheduler = Scheduler(problem)
    return scheduler.current() or scheduler.arrival_order()


def _order_search(problem: FleetProblem, budget_s: float, seed: int) -> Schedule:
    return searched(problem, budget_s=budget_s, seed=seed).best


def _ortools(problem: FleetProblem, budget_s: float, _seed: int) -> Schedule:
    """The order that OR-Tools finds, planned by the exact planner."""
    scheduler = Scheduler(problem)
    return scheduler.planned(ordered_by_ortools(problem, scheduler.estimates, budget_s=budget_s))


FIRST_COME: Final = Policy("first come, first served", _first_come)

ORDER_SEARCH: Final = Policy("order search", _order_search)

POOLING: Final = Policy("order search, pooling", _order_search, pooling=True)

ORTOOLS: Final = Policy("OR-Tools' order", _ortools)
