"""Compose: from a problem to a plan that is verified, or to the reason why there is none.

This is the planner's front door, and the file to read first. What is asked is in `problem`, what
comes out in `skyway.delivery.plan`; each strategy is a file of its own, and `verify` trusts none.
"""

from collections import defaultdict
from collections.abc import Iterable, Mapping
from types import MappingProxyType

from skyway.delivery.plan import (
    Deliver,
    Fly,
    Infeasibility,
    PackageDelivery,
    PickUp,
    Plan,
    PlanStatus,
    Recharge,
    Wait,
)
from skyway.errors import InvalidProblem
from skyway.planner.airspace import Airspace
from skyway.planner.exact import exact
from skyway.planner.exhaustive import exhaustive, exhaustive_with_walks
from skyway.planner.findings import Findings, Strategy
from skyway.planner.flight_log import StepFields
from skyway.planner.heuristic import heuristic
from skyway.planner.hierarchy import Hierarchy
from skyway.planner.infeasible import not_carried, proof_of_infeasibility
from skyway.planner.itinerary import Itinerary
from skyway.planner.pad_book import NO_RESERVATIONS, PadBook
from skyway.planner.problem import Problem
from skyway.planner.situation import Situation
from skyway.planner.stop import Effort, OutOfTime, Stop, TimeLimit, first_of, never, stopwatch
from skyway.planner.verify import PlanRejected, verify

STRATEGIES: Mapping[str, Strategy] = MappingProxyType(
    {
        "exact": exact,
        "heuristic": heuristic,
        "exhaustive": exhaustive,
        "exhaustive_with_walks": exhaustive_with_walks,
    }
)

DEFAULT_STRATEGY = "exact"

_STEPS: Mapping[str, type[PickUp | Fly | Wait | Recharge | Deliver]] = {
    "PICK_UP": PickUp,
    "FLY": Fly,
    "WAIT": Wait,
    "RECHARGE": Recharge,
    "DELIVER": Deliver,
}


def compose(
    problem: Problem,
    *,
    stop: Stop = never,
    airspace: Airspace | None = None,
    booked: PadBook = NO_RESERVATIONS,
    hierarchy: Hierarchy | None = None,
) -> Plan:
    """The plan that delivers every package as early as the problem's strategy can find.

    Parameters
    ----------
    problem
        What to deliver, with which drone, through which network.
    stop
        Ends the search early, besides the problem's own limits.
    airspace
        `Airspace.of(problem.network)`, for who composes more than once on one network.
    booked
        Pads held by others, beside the problem's own `pad_reservations`; only the stations that
        the search meets are looked up.
    hierarchy
        `Hierarchy.of(problem.network)`, worth making where many problems span one network.

    Returns
    -------
    Plan
        A verified plan; or infeasible with its proof; or unknown, when neither was found.

    Raises
    ------
    InvalidProblem
        No strategy has the name that the problem gives.
    PlanRejected
        A strategy made a plan that breaks the problem's rules: a defect of the planner.
    """
    strategy_name, strategy = _strategy_of(problem)
    return compose_with(
        strategy,
        problem,
        name=strategy_name,
        stop=stop,
        airspace=airspace,
        booked=booked,
        hierarchy=hierarchy,
    )


def compose_with(
    strategy: Strategy,
    problem: Problem,
    *,
    name: str,
    stop: Stop = never,
    airspace: Airspace | None = None,
    booked: PadBook = NO_RESERVATIONS,
    hierarchy: Hierarchy | None = None,
) -> Plan:
    """`compose` with the caller's own strategy, which the plan's stats call `name`."""
    if problem.time_limit_s is not None:
        stop = first_of(stop, TimeLimit(problem.time_limit_s))
    elapsed_s = stopwatch()
    effort = Effort(stop, most_labels=problem.label_limit)

    cargo_reason = not_carried(problem)
    if cargo_reason is not None:
        plan, searched = _infeasible(cargo_reason), 0
    else:
        try:
            sky = airspace or Airspace.of(problem.network, stop=stop)
        except OutOfTime:
            plan, searched = Plan(status=PlanStatus.UNKNOWN), 0
        else:
            situation = Situation.of(problem, sky, booked, hierarchy=hierarchy)
            findings = strategy(situation, effort)
            plan, searched = _plan_of(situation, findings, stop), findings.stations_searched

    stats = {
        "strategy": name,
        "elapsed_s": elapsed_s(),
        "labels": effort.labels,
        "compositions": effort.compositions,
        "stations_searched": searched,
    }
    return _verified(problem, plan.model_copy(update={"stats": stats}), booked)


def _strategy_of(problem: Problem) -> tuple[str, Strategy]:
    name = DEFAULT_STRATEGY if problem.strategy is None else problem.strategy
    if name not in STRATEGIES:
        raise InvalidProblem(
            "strategy", f"{name!r} is not a strategy; there are {', '.join(STRATEGIES)}"
        )
    return name, STRATEGIES[name]


def _plan_of(situation: Situation, findings: Findings, stop: Stop) -> Plan:
    """The plan found; without a plan, the proof that there is none, if the proof is cheap."""
    if findings.itinerary is not None:
        status = PlanStatus.OPTIMAL if findings.is_proven_best else PlanStatus.FEASIBLE
        return flyable(findings.itinerary, status, findings.lower_bound_s)
    proof = findings.infeasibility
    # The cheap proofs are about still air.
    is_calm = situation.problem.weather is None
    if proof is None and findings.lower_bound_s is None and is_calm:
        proof = proof_of_infeasibility(situation, stop)
    if proof is not None:
        return _infeasible(proof)
    return Plan(status=PlanStatus.UNKNOWN, lower_bound_s=findings.lower_bound_s)


def _infeasible(infeasibility: Infeasibility) -> Plan:
    return Plan(status=PlanStatus.INFEASIBLE, infeasibility=infeasibility)


def flyable(itinerary: Itinerary, status: PlanStatus, lower_bound_s: float | None) -> Plan:
    """The plan of this itinerary."""
    by_kind = defaultdict(list)
    for fields in itinerary.steps:
        by_kind[fields["kind"]].append(fields)
    # Nothing is validated here: `verify` checks every plan, and more than its types.
    return Plan.model_construct(
        status=status,
        delivery_time_s=itinerary.delivered_s,
        lower_bound_s=lower_bound_s,
        energy_j=sum((fields["energy_j"] for fields in by_kind["FLY"]), 0.0),
        flight_s=_total_s(by_kind["FLY"]),
        waiting_s=_total_s(by_kind["WAIT"]),
        recharging_s=_total_s(by_kind["RECHARGE"]),
        steps=tuple(_STEPS[fields["kind"]].of_members(fields) for fields in itinerary.steps),
        deliveries=tuple(
            PackageDelivery(
                package_id=package_id,
                station_id=fields["station_id"],
                delivered_s=fields["end_s"],
            )
            for fields in by_kind["DELIVER"]
            for package_id in fields["package_ids"]
        ),
    )


def _total_s(steps: Iterable[StepFields]) -> float:
    return sum((step["end_s"] - step["start_s"] for step in steps), 0.0)


def _verified(problem: Problem, plan: Plan, booked: PadBook) -> Plan:
    violations = verify(problem, plan, booked=booked)
    if violations:
        raise PlanRejected(violations)
    return plan
