"""The result of a strategy, and the signature of every strategy."""

from collections.abc import Callable
from dataclasses import dataclass

from skyway.delivery.plan import Infeasibility
from skyway.planner.itinerary import Itinerary
from skyway.planner.situation import Situation
from skyway.planner.stop import Effort
from skyway.units import time_tolerance_s


@dataclass(frozen=True, slots=True)
class Findings:
    """The best itinerary found or None, and how many stations the search examined.

    `lower_bound_s` is a moment before which no plan delivers everything, None where none is
    proven; `infeasibility` the proof that there is no plan, if the search has made one.
    """

    itinerary: Itinerary | None
    stations_searched: int
    lower_bound_s: float | None = None
    infeasibility: Infeasibility | None = None

    @property
    def is_proven_best(self) -> bool:
        """Whether no plan delivers earlier than the itinerary."""
        return (
            self.itinerary is not None
            and self.lower_bound_s is not None
            and self.itinerary.delivered_s
            <= self.lower_bound_s + time_tolerance_s(self.lower_bound_s)
        )


Strategy = Callable[[Situation, Effort], Findings]


def is_better(situation: Situation, itinerary: Itinerary, best: Itinerary | None) -> bool:
    """Whether this itinerary delivers in time, and earlier than the best so far."""
    latest_s = situation.problem.latest_delivery_s
    if itinerary.is_stuck:
        return False
    if latest_s is not None and itinerary.delivered_s > latest_s + time_tolerance_s(latest_s):
        return False
    return best is None or itinerary.delivered_s < best.delivered_s
