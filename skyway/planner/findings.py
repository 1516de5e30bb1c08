"""What a strategy hands back, and the form that every strategy has."""

from collections.abc import Callable
from dataclasses import dataclass

from skyway.planner.itinerary import Itinerary
from skyway.planner.situation import Situation
from skyway.planner.stop import Effort
from skyway.units import TIME_TOLERANCE_S


@dataclass(frozen=True, slots=True)
class Findings:
    """The best itinerary found, None without one, and how many stations the search looked at."""

    itinerary: Itinerary | None
    stations_searched: int


Strategy = Callable[[Situation, Effort], Findings]


def is_better(situation: Situation, itinerary: Itinerary, best: Itinerary | None) -> bool:
    """Whether this itinerary delivers in time, and earlier than the best so far."""
    latest_s = situation.problem.latest_delivery_s
    if itinerary.is_stuck:
        return False
    if latest_s is not None and itinerary.delivered_s > latest_s + TIME_TOLERANCE_S:
        return False
    return best is None or itinerary.delivered_s < best.delivered_s
