"""Orders of destinations, the cheapest first."""

import heapq
import math
from collections.abc import Callable, Iterator
from functools import cache

#: cost(at, to, undelivered): from destination `at` (`SOURCE` is the source) to destination `to`
#: while the destinations in the bit set `undelivered` still wait, `to` among them.
LegCost = Callable[[int, int, int], float]

SOURCE = -1


def orders_by_cost(destinations: int, cost: LegCost) -> Iterator[tuple[float, tuple[int, ...]]]:
    """All orders of so many destinations with their finite costs, the cheapest first.

    Best-first search over the beginnings of orders; what an order still costs is known exactly,
    by a dynamic programme over subsets (Held and Karp 1962), so the first order takes no search.
    """

    @cache
    def still_costs(at: int, undelivered: int) -> float:
        return min(
            (
                cost(at, to, undelivered) + still_costs(to, undelivered & ~(1 << to))
                for to in _members(undelivered)
            ),
            default=0.0,
        )

    everything = (1 << destinations) - 1
    beginnings: list[tuple[float, tuple[int, ...], float, int]] = [
        (still_costs(SOURCE, everything), (), 0.0, everything)
    ]
    while beginnings and beginnings[0][0] < math.inf:
        total, order, so_far, undelivered = heapq.heappop(beginnings)
        if not undelivered:
            yield total, order
            continue
        at = order[-1] if order else SOURCE
        for to in _members(undelivered):
            cost_to = so_far + cost(at, to, undelivered)
            left = undelivered & ~(1 << to)
            heapq.heappush(
                beginnings, (cost_to + still_costs(to, left), (*order, to), cost_to, left)
            )


def _members(bit_set: int) -> Iterator[int]:
    member = 0
    while bit_set >> member:
        if bit_set >> member & 1:
            yield member
        member += 1
