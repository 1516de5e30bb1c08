"""Optimise: from a fleet problem to a fleet plan that costs no more than the arrival order.

This is the file to read first. `problem` defines the input, and `plan` the result;
docs/dispatch.md explains the method.
"""

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from skyway.dispatch.best_order import BestOrder
from skyway.dispatch.bound import lower_bound_s
from skyway.dispatch.check import violations
from skyway.dispatch.kept_promises import repaired
from skyway.dispatch.objective import Limits, promised_s
from skyway.dispatch.order_moves import Order, OrderMoves
from skyway.dispatch.plan import FleetPlan
from skyway.dispatch.problem import FleetProblem
from skyway.dispatch.row_bounds import is_small
from skyway.dispatch.rows import Board
from skyway.dispatch.schedule import Scheduler
from skyway.dispatch.search import MOST_STEPS, OrderSearch
from skyway.errors import SkywayError
from skyway.planner.kernels.memory import Longs
from skyway.planner.stop import processor_stopwatch

#: Seconds of processor time if the caller gives no budget.
DEFAULT_BUDGET_S = 10.0

#: One round of annealing makes at most so many steps for each second of the budget. They use about
#: half of the budget.
_STEPS_PER_S = 150_000

#: The seeds of several searches of one problem are so far apart. Our own choice: a caller that uses
#: one seed after another gets other random numbers in each search.
_SEEDS_APART = 1_000_003

#: The most steps of a lower bound.
_BOUND_STEPS = 400


def optimise(
    problem: FleetProblem,
    *,
    budget_s: float = DEFAULT_BUDGET_S,
    rounds: int | None = None,
    seed: int = 0,
    proves: bool = False,
    searches: int = 1,
    executor: Executor | None = None,
) -> FleetPlan:
    """The best fleet plan that the search finds.

    The plan never costs more than the problem's baseline. A request with a promise is delivered
    before the promise within the problem's tolerance, or no later than in the baseline. Every trip
    has passed the planner's `verify`.

    Parameters
    ----------
    budget_s
        Seconds of processor time. The arrival order and a round that has begun are always finished.
    rounds
        Ends the search after so many rounds instead. Then the same seed gives the same plan on
        every machine.
    seed
        The seed of the search's random numbers.
    proves
        Also prove a lower bound of the objective, which takes some more seconds.
    searches
        So many searches with different random numbers; the best plan counts. Each search has the
        whole budget.
    executor
        Runs the searches in parallel. Without it they run here, one after another; the plans are
        the same.
    """
    if searches == 1 and executor is None:
        search = searched(problem, budget_s=budget_s, rounds=rounds, seed=seed)
    else:
        seeds = range(seed, seed + searches * _SEEDS_APART, _SEEDS_APART)
        tasks = [_Task(problem, budget_s, rounds, each) for each in seeds]
        search = _best_of(tasks, executor)
    bound_s = proven_s(search) if proves else None
    search.scheduler.planner.begin()
    plan = FleetPlan.of(
        problem,
        search.best,
        arrival=search.arrival,
        rounds=search.rounds,
        is_best_order=search.is_proven,
        lower_bound_s=bound_s,
    )
    faults = violations(problem, plan)
    if faults:
        raise FleetPlanRejected(faults)
    return plan


def searched(
    problem: FleetProblem,
    *,
    budget_s: float = DEFAULT_BUDGET_S,
    rounds: int | None = None,
    most_steps: int = MOST_STEPS,
    seed: int = 0,
) -> OrderSearch:
    """The search of `optimise` at its end; each round has at most so many steps of annealing."""
    elapsed_s = processor_stopwatch()

    def is_over(made: int) -> bool:
        return elapsed_s() >= budget_s if rounds is None else made >= rounds

    if rounds is None:
        most_steps = min(most_steps, max(1, int(budget_s * _STEPS_PER_S)))
    search = begun(problem, seed=seed)
    search.most_steps = most_steps
    search.run(is_over)
    return search


def begun(problem: FleetProblem, *, seed: int = 0) -> OrderSearch:
    """The search of `optimise` before its first round."""
    scheduler = Scheduler(problem)
    arrival = scheduler.arrival_order()
    current = scheduler.current()
    baseline = arrival
    if problem.baseline == "current plan" and current is not None:
        # Each new request was planned last. In another order it could take the pads of others.
        baseline = current = repaired(scheduler, current, promised_s(problem))
    limits = Limits(problem, baseline.costs)
    board = Board(
        problem,
        scheduler.estimates,
        kinds=scheduler.planner.model_of,
        shared=scheduler.planner.sharing.pools(),
    )
    board.limit(limits)
    scheduler.planner.keep(limits.latest_s)
    moves = OrderMoves(
        len(problem.requests),
        len(problem.drones),
        allows=scheduler.planner.sharing.allows,
        draws=np.random.default_rng(seed),
    )
    search = OrderSearch(
        scheduler,
        board,
        limits,
        arrival,
        baseline,
        _chance(seed),
        moves,
        BestOrder(scheduler, limits) if is_small(problem) else None,
    )
    for each in (arrival, current):
        search.look_at(each)
    return search


@dataclass(frozen=True, slots=True)
class _Task:
    """One of several searches; a worker process can receive it."""

    problem: FleetProblem
    budget_s: float
    rounds: int | None
    seed: int


def _found(task: _Task) -> tuple[Order, int, bool]:
    """The order of the best schedule that a search finds, its rounds, and whether it is proven."""
    search = searched(task.problem, budget_s=task.budget_s, rounds=task.rounds, seed=task.seed)
    return search.best.order, search.rounds, search.is_proven


def _best_of(tasks: Sequence[_Task], executor: Executor | None) -> OrderSearch:
    """A search whose best schedule is the best one that these searches find."""
    found = map(_found, tasks) if executor is None else executor.map(_found, tasks)
    best = begun(tasks[0].problem, seed=tasks[0].seed)
    for order, rounds, is_proven in found:
        best.look_at(best.scheduler.in_order(order))
        best.rounds += rounds
        best.is_proven |= is_proven
    return best


class FleetPlanRejected(SkywayError):
    """A fleet plan breaks rules, a defect of the dispatcher. `faults` names the broken rules."""

    def __init__(self, faults: Sequence[str]) -> None:
        super().__init__("; ".join(faults))
        self.faults = tuple(faults)


def proven_s(search: OrderSearch) -> float:
    """A lower bound of the objective of every plan of the search's problem."""
    scheduler = search.scheduler
    return lower_bound_s(
        scheduler.problem,
        scheduler.estimates,
        kinds=scheduler.planner.model_of,
        pools=search.board.pools if search.board.has_all_pools else None,
        upper=search.best.costs,
        is_over=lambda steps: steps >= _BOUND_STEPS,
    )


def _chance(seed: int) -> Longs:
    """The first state of the random numbers: never 0, and very different for similar seeds."""
    return np.array([(seed * 0x9E3779B97F4A7C15 + 0x1234567) % (2**62) + 1], np.int64)
