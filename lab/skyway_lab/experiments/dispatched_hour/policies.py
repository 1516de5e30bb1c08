"""The policies: a fleet problem in, a schedule out."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from skyway.dispatch.optimise import searched
from skyway.dispatch.problem import FleetProblem
from skyway.dispatch.schedule import Schedule, Scheduler

#: A problem and a seed.
Plan = Callable[[FleetProblem, int], Schedule]

#: Measured: 10 to 18 minutes were tried.
_MOST_WAIT_S: Final = 900.0

#: Measured: 0 to 15 minutes were tried.
_AHEAD_S: Final = 300.0

#: About the time that a drone charges for a kWh (4 h). Measured: 12,000 to 30,000 were tried.
_ENERGY_S_PER_KWH: Final = 14_400.0


#: A promised delivery is far when it is so long after its request. Our own choice, near the mean of
#: the city's hour.
FAR_S: Final = 5_100.0


@dataclass(frozen=True, slots=True)
class DispatchPolicy:
    """How the open requests of a fleet are planned.

    Parameters
    ----------
    pooling
        Whether requests may share trips.
    most_wait_s
        While requests still come, a trip waits for more requests until its oldest one is so old.
    ahead_s
        While a trip waits, its drone flies to the pickup without packages. It arrives about so
        long before `most_wait_s` ends. None: the drone stays until the trip begins.
    energy_s_per_kwh
        The price of energy while requests still come: later requests need the charge.
    promise_tolerance_s
        The width of a promise: plans after it deliver at most so much later than the plan that was
        promised. None: there are no promises.
    wider_by
        The width grows by so many seconds for each second between request and promised delivery
        beyond `FAR_S`.
    firm_within_s
        A request is promised what the last plan says before the request is so old, or the plan
        with which its trip begins. A request that is so old before its first plan is promised the
        first plan.
    window_s
        A delivery that has a begin is promised until so long after it, if that is later. Then its
        seconds count `WINDOW_WEIGHT`. 0: only the moment of its plan is promised.
    batch_s
        Requests are planned together at multiples of so many seconds, and all again each minute.
    """

    name: str
    plan: Plan
    pooling: bool = False
    most_wait_s: float = 0.0
    ahead_s: float | None = None
    energy_s_per_kwh: float = 0.0
    promise_tolerance_s: float | None = None
    wider_by: float = 0.0
    firm_within_s: float = 0.0
    window_s: float = 0.0
    batch_s: float = 60.0


def _first_come(problem: FleetProblem, _seed: int) -> Schedule:
    """The current plan, and new requests booked behind it as they came."""
    scheduler = Scheduler(problem)
    return scheduler.current() or scheduler.arrival_order()


FIRST_COME: Final = DispatchPolicy("first come, first served", _first_come)


def searches(plan: Plan) -> tuple[DispatchPolicy, DispatchPolicy, DispatchPolicy]:
    """Three policies of one search: requests alone, shared trips, and shared trips that wait.

    While a trip waits, its drone flies ahead.
    """
    return (
        DispatchPolicy("order search", plan),
        DispatchPolicy("pooling", plan, pooling=True),
        DispatchPolicy(
            "pooling, trips wait",
            plan,
            pooling=True,
            most_wait_s=_MOST_WAIT_S,
            ahead_s=_AHEAD_S,
            energy_s_per_kwh=_ENERGY_S_PER_KWH,
        ),
    )


def searched_for(budget_s: float) -> Plan:
    """The dispatcher's search with this much processor time for each plan."""

    def plan(problem: FleetProblem, seed: int) -> Schedule:
        return searched(problem, budget_s=budget_s, seed=seed).best

    return plan


def searched_in_rounds(rounds: int, *, most_steps: int) -> Plan:
    """The dispatcher's search with so many rounds for each plan: the same on every machine."""

    def plan(problem: FleetProblem, seed: int) -> Schedule:
        return searched(problem, rounds=rounds, most_steps=most_steps, seed=seed).best

    return plan
