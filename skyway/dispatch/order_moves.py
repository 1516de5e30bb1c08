"""Random small changes of the order in which a schedule's trips are planned.

The exact planner judges every change. So these moves see what estimates do not: which pads are
missing or held, and what it costs when one drone is planned before another.
"""

from collections.abc import Callable
from typing import Final

from numpy.random import Generator

from skyway.dispatch.planned_trip import Pool
from skyway.planner.kernels.memory import Longs

#: Trips in the order in which they are planned: the number of each drone, and its requests.
Order = tuple[tuple[int, Pool], ...]

#: The share of changes that only move a trip before or after trips of other drones, and by how many
#: trips at most. Our own choice.
_ONLY_PLANNED_EARLIER: Final = 0.5
_MOST_EARLIER: Final = 12

#: The share of further moves, after which the change ends. Our own choice.
_ONE_MORE: Final = 0.6

#: Seconds by which a lead changes, about, and the share of changes that begin at no lead. Our own
#: choice.
_LEAD_S: Final = 1_800.0
_NO_LEAD: Final = 0.5

#: The share of requests that join another trip if one may share it.
_JOINS: Final = 0.5


class OrderMoves:
    """Draws changes of orders.

    Parameters
    ----------
    allows
        Whether these requests may share a trip.
    """

    def __init__(
        self, requests: int, drones: int, *, allows: Callable[[Pool], bool], draws: Generator
    ) -> None:
        self._requests = requests
        self._drones = drones
        self._allows = allows
        self.draws = draws

    def changed(self, order: Order) -> Order:
        """Return the order after one random change, of one move or more."""
        draws = self.draws
        trips = [*order]
        is_only_planned_earlier = draws.random() < _ONLY_PLANNED_EARLIER
        while True:
            if is_only_planned_earlier and trips:
                self._plan_earlier_or_later(trips)
            else:
                (self._reassign, self._exchange, self._regroup)[draws.integers(3)](trips)
            if draws.random() >= _ONE_MORE:
                return tuple(trips)

    def other_leads(self, leads_ms: Longs) -> Longs:
        """Return these leads of the requests after a random change of one lead or more."""
        draws, found_ms = self.draws, leads_ms.copy()
        while True:
            number = draws.integers(found_ms.size)
            before_ms = 0 if draws.random() < _NO_LEAD else found_ms[number]
            found_ms[number] = before_ms + int(1000 * _LEAD_S * draws.standard_normal())
            if draws.random() >= _ONE_MORE:
                return found_ms

    def _plan_earlier_or_later(self, trips: list[tuple[int, Pool]]) -> None:
        """Move a trip among the trips of other drones: each drone flies its trips as before."""
        at = int(self.draws.integers(len(trips)))
        trip = trips.pop(at)
        first, last = max(0, at - _MOST_EARLIER), min(len(trips), at + _MOST_EARLIER)
        for number in range(at - 1, first - 1, -1):
            if trips[number][0] == trip[0]:
                first = number + 1
                break
        for number in range(at, last):
            if trips[number][0] == trip[0]:
                last = number
                break
        trips.insert(int(self.draws.integers(first, last + 1)), trip)

    def _reassign(self, trips: list[tuple[int, Pool]]) -> None:
        """Let any drone fly a trip, at any place."""
        if trips:
            _, pool = trips.pop(self.draws.integers(len(trips)))
            self._insert(trips, pool)

    def _exchange(self, trips: list[tuple[int, Pool]]) -> None:
        """Exchange the requests of two trips."""
        if len(trips) > 1:
            one, other = self.draws.choice(len(trips), 2, replace=False).tolist()
            (drone, pool), (other_drone, other_pool) = trips[one], trips[other]
            trips[one], trips[other] = (drone, other_pool), (other_drone, pool)

    def _regroup(self, trips: list[tuple[int, Pool]]) -> None:
        """Take a request out of its trip, if it has one; it joins another trip or flies alone."""
        request = int(self.draws.integers(self._requests))
        for at, (drone, pool) in enumerate(trips):
            if request in pool:
                rest = tuple(each for each in pool if each != request)
                trips[at : at + 1] = [(drone, rest)] if rest else []
                break
        joined = [
            (at, drone, together)
            for at, (drone, pool) in enumerate(trips)
            if self._allows(together := tuple(sorted((*pool, request))))
        ]
        if joined and self.draws.random() < _JOINS:
            at, drone, together = joined[self.draws.integers(len(joined))]
            trips[at] = (drone, together)
        else:
            self._insert(trips, (request,))

    def _insert(self, trips: list[tuple[int, Pool]], pool: Pool) -> None:
        drone = int(self.draws.integers(self._drones))
        trips.insert(int(self.draws.integers(len(trips) + 1)), (drone, pool))
