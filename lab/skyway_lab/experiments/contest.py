"""One run of one contestant on one instance: its time, its plan, and whether a limit ended it."""

from collections.abc import Sequence
from dataclasses import dataclass

from skyway.delivery.plan import Plan
from skyway.planner.airspace import Airspace
from skyway.planner.compose import STRATEGIES, compose_with
from skyway.planner.findings import Strategy
from skyway.planner.pad_book import PadBook
from skyway.planner.problem import Problem
from skyway_lab.experiments.plain_python import plain_python

HEURISTIC = "heuristic"
EXHAUSTIVE = "exhaustive"
EXACT = "exact"
#: The same code as `exact`, interpreted: the contestants' own language.
EXACT_PLAIN = "exact, plain Python"


@dataclass(frozen=True, slots=True)
class Run:
    """The run of one contestant on one instance.

    `is_censored` says that the limit ended the run. The true time is then at least `elapsed_s`,
    and the plan is only the best so far. `labels` counts the states that the contestant looked at,
    `compositions` the whole routes that it simulated (0 for `exact`, which simulates none).
    """

    contestant: str
    status: str
    elapsed_s: float
    is_censored: bool
    labels: int
    compositions: int
    delivery_s: float | None
    lower_bound_s: float | None
    recharging_s: float | None
    waiting_s: float | None


def contest(
    problem: Problem, contestants: Sequence[str], *, limit_s: float, turn: int = 0
) -> list[Run]:
    """The runs of all contestants on this instance, one after the other in this process.

    `turn` chooses the contestant that begins, so that no contestant always runs first.
    """
    first = turn % len(contestants)
    in_turn = [*contestants[first:], *contestants[:first]]
    runs = {contestant: run(problem, contestant, limit_s=limit_s) for contestant in in_turn}
    return [runs[contestant] for contestant in contestants]


def run(problem: Problem, contestant: str, *, limit_s: float, booked: PadBook | None = None) -> Run:
    """The run of one contestant, by its name: a strategy of the planner, or `EXACT_PLAIN`.

    `booked` takes the place of the problem's own reservations.
    """
    if contestant != EXACT_PLAIN:
        strategy = STRATEGIES[contestant]
        return run_strategy(problem, contestant, strategy, limit_s=limit_s, booked=booked)
    limited = problem.model_copy(update={"strategy": EXACT, "time_limit_s": limit_s})
    return run_of(plain_python().compose(limited), contestant, limit_s=limit_s)


def run_strategy(
    problem: Problem,
    name: str,
    strategy: Strategy,
    *,
    limit_s: float,
    booked: PadBook | None = None,
) -> Run:
    """The run of a strategy under this name.

    The network and the reservations are prepared before the run, as a service keeps them.
    """
    if booked is None:
        booked = PadBook.of(problem.network, problem.pad_reservations)
    limited = problem.model_copy(update={"time_limit_s": limit_s, "pad_reservations": ()})
    airspace = Airspace.of(problem.network)
    plan = compose_with(strategy, limited, name=name, airspace=airspace, booked=booked)
    return run_of(plan, name, limit_s=limit_s)


def run_of(plan: Plan, contestant: str, *, limit_s: float) -> Run:
    """The run that made this plan, read from the plan's statistics."""
    elapsed_s = plan.stats["elapsed_s"]
    return Run(
        contestant=contestant,
        status=plan.status.value,
        elapsed_s=elapsed_s,
        is_censored=elapsed_s >= limit_s,
        labels=plan.stats["labels"],
        compositions=plan.stats.get("compositions", 0),
        delivery_s=plan.delivery_time_s,
        lower_bound_s=plan.lower_bound_s,
        recharging_s=plan.recharging_s,
        waiting_s=plan.waiting_s,
    )
