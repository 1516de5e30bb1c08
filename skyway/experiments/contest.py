"""One contestant on one instance: how long it took, what it found, and whether a limit ended it."""

from collections.abc import Sequence
from dataclasses import dataclass

from skyway.delivery.plan import Plan
from skyway.experiments.plain_python import plain_python
from skyway.planner.airspace import Airspace
from skyway.planner.compose import STRATEGIES, compose_with
from skyway.planner.findings import Strategy
from skyway.planner.pad_book import PadBook
from skyway.planner.problem import Problem

HEURISTIC = "heuristic"
EXHAUSTIVE = "exhaustive"
EXACT = "exact"
#: The same code as `exact`, interpreted: the contestants' own language.
EXACT_PLAIN = "exact, plain Python"


@dataclass(frozen=True, slots=True)
class Run:
    """What one contestant did with one instance.

    `is_censored`: its limit ended it, so that its time is only known to be at least `elapsed_s`,
    and a plan that it has is only the best so far. `labels` are the states that it looked at,
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

    `turn` says which begins, so that over many instances none always runs first.
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

    The network and the reservations are made ready before, as a service keeps them.
    """
    if booked is None:
        booked = PadBook.of(problem.network, problem.pad_reservations)
    limited = problem.model_copy(update={"time_limit_s": limit_s, "pad_reservations": ()})
    airspace = Airspace.of(problem.network)
    plan = compose_with(strategy, limited, name=name, airspace=airspace, booked=booked)
    return run_of(plan, name, limit_s=limit_s)


def run_of(plan: Plan, contestant: str, *, limit_s: float) -> Run:
    """What this plan says of the search that made it."""
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
