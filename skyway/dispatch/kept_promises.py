"""Repairs promises that a schedule breaks only because of the order in which its trips are planned.

The drone that is free first is planned first, and gets the pads. So a trip can be late because the
trips of other drones, which have no promise or a later one, are planned before it.
"""

from collections.abc import Mapping
from typing import Final

import numpy as np

from skyway.dispatch.objective import Costs
from skyway.dispatch.schedule import Schedule, Scheduler

#: How much sooner a late trip, and each trip before it of its drone, is planned after each try, and
#: the most tries. Our own choice.
_SOONER_MS: Final = 1_800_000
_TRIES: Final = 3


def repaired(scheduler: Scheduler, found: Schedule, latest_s: Mapping[int, float]) -> Schedule:
    """The same trips, planned in an order in which promises are broken by fewer seconds.

    Returns `found` if no such order is found. `latest_s` is the latest delivery by request.
    """
    sequences = found.sequences(len(scheduler.problem.drones))
    leads_ms = np.zeros(len(scheduler.problem.requests), np.int64)
    best, planned = found, found
    for _ in range(_TRIES):
        late = _late_s(planned.costs, latest_s)
        if not late:
            break
        for row in sequences:
            is_late = [not late.keys().isdisjoint(pool) for pool in row]
            for number, pool in enumerate(row):
                leads_ms[pool[0]] += _SOONER_MS * sum(is_late[number:])
        planned = scheduler.planned(sequences, leads_ms=leads_ms)
        if _late_sum_s(planned, latest_s) < _late_sum_s(best, latest_s):
            best = planned
    return best


def _late_s(costs: Costs, latest_s: Mapping[int, float]) -> dict[int, float]:
    """By how much each request that breaks its promise is late."""
    return {
        number: moment_s - latest_s[number]
        for number, moment_s in costs.delivered_s.items()
        if number in latest_s and moment_s > latest_s[number]
    }


def _late_sum_s(schedule: Schedule, latest_s: Mapping[int, float]) -> float:
    return sum(_late_s(schedule.costs, latest_s).values())
