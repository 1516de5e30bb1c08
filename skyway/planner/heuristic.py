"""The paper's heuristic composition, with the widening that it leaves to future work.

The sector is widened, up to the whole network, while it holds no plan. If its best plan has to wait
for a pad or for something closed, the whole network is searched for a way around as well: plans
avoid congestion.

Notes
-----
Shahzaad and Bouguettaya, Algorithm 1. Step 1 drops what lies outside the sector of the lines of
sight; step 2 takes shortest paths, a matrix of delivery times and the best order from it. The paper
can be read in two ways: the order that is best by the static matrix, or the best of all orders once
each is simulated. Here the matrix ranks the orders and each is simulated in turn, until the next
one's least time in the matrix is no earlier than the best plan: the first is the first reading's,
the best is the second's.
"""

from collections.abc import Sequence
from functools import partial
from itertools import islice

from skyway.ids import StationId
from skyway.planner.airspace import SegmentEnds
from skyway.planner.findings import Findings, Strategy, is_better
from skyway.planner.itinerary import Itinerary, fly
from skyway.planner.matrix import TimeMatrix, orders_by_cost
from skyway.planner.route import find_route, stretches
from skyway.planner.situation import Situation
from skyway.planner.stop import Effort
from skyway.planner.subnetwork import Subnetwork, widening_sectors

#: Most orders simulated in one sector: all orders of up to five destinations. Our own choice.
_MAX_ORDERS = 120
#: Most routes tried for one order, each avoiding one more congested or closed place of the last
#: one. Our own choice.
_MAX_ROUTES = 8


def heuristic(situation: Situation, effort: Effort) -> Findings:
    """The best plan of the narrowest sector that holds one, or a detour if that plan waits."""
    return _find(situation, effort, first_sector=0)


def heuristic_from(first_sector: int) -> Strategy:
    """The heuristic that begins with a wider sector than the paper's, by its number."""
    return partial(_find, first_sector=first_sector)


def _find(situation: Situation, effort: Effort, *, first_sector: int) -> Findings:
    situation.refuse_weather()
    whole = Subnetwork.whole(situation)
    best, sector = _in_narrowest_sector(situation, whole, effort, first_sector=first_sector)
    if best is None or not best.hindrances or sector is whole:
        return Findings(best, len(sector.stations))
    around = _best_in_sector(situation, whole, approach=whole, effort=effort)
    if around is not None and is_better(situation, around, best):
        best = around
    return Findings(best, len(whole.stations))


def _in_narrowest_sector(
    situation: Situation, whole: Subnetwork, effort: Effort, *, first_sector: int
) -> tuple[Itinerary | None, Subnetwork]:
    """Widen the sector until it holds a plan; the last one is the whole network."""
    sectors = widening_sectors(
        situation.network,
        situation.problem.source,
        targets=situation.destinations,
        first=first_sector,
    )
    for stations in sectors:
        is_whole = len(stations) == len(whole.stations)
        sector = whole if is_whole else Subnetwork(situation, stations)
        best = _best_in_sector(situation, sector, approach=whole, effort=effort)
        if best is not None or effort.stop(effort.labels):
            return best, sector
    return None, whole


def _best_in_sector(
    situation: Situation, sector: Subnetwork, *, approach: Subnetwork, effort: Effort
) -> Itinerary | None:
    """Simulate the orders by their least time in the matrix; keep the best."""
    matrix = TimeMatrix(situation, sector, approach=approach)
    ranked = orders_by_cost(len(situation.destinations), matrix.flight_and_recharge_s)
    best: Itinerary | None = None
    for least_s, numbers in islice(ranked, _MAX_ORDERS):
        if best is not None and matrix.delivery_bound_s(least_s) >= best.delivered_s:
            break
        if effort.is_spent():
            break
        order = [situation.destinations[number] for number in numbers]
        for itinerary in _itineraries(situation, order, sector, approach, effort):
            if is_better(situation, itinerary, best):
                best = itinerary
    return best


def _itineraries(
    situation: Situation,
    order: Sequence[StationId],
    sector: Subnetwork,
    approach: Subnetwork,
    effort: Effort,
) -> list[Itinerary]:
    """Itineraries of this order: of the shortest route, then of routes around each obstacle."""
    flights = stretches(situation, order, subnetwork=sector, approach=approach)
    avoided: set[SegmentEnds | StationId] = set()
    itineraries: list[Itinerary] = []
    while len(itineraries) < _MAX_ROUTES:
        route = find_route(situation, flights, avoided=avoided, effort=effort)
        if route is None:
            break
        itinerary = fly(situation, route)
        effort.compositions += 1
        itineraries.append(itinerary)
        hindrance = next((met for met in itinerary.hindrances if met not in avoided), None)
        if hindrance is None:
            break
        avoided.add(hindrance)
    return itineraries
