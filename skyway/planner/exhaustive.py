"""The paper's baseline: every order and every path over the whole network, enumerated.

Its time grows exponentially with the network; that is its point. It prunes nothing, so that it
stays a fair measure of the heuristic, and proves nothing, since it recharges by the same rule.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import permutations

from skyway.ids import StationId
from skyway.network.network import Segment
from skyway.planner.findings import Findings, is_better
from skyway.planner.itinerary import Itinerary, fly
from skyway.planner.route import Leg, Route, Stretch, stretches
from skyway.planner.situation import Situation
from skyway.planner.stop import Effort
from skyway.planner.subnetwork import Subnetwork


def exhaustive(situation: Situation, effort: Effort) -> Findings:
    """The best plan over all orders and all simple paths, as in the paper's evaluation."""
    return _best_of_all(situation, effort, visits=1)


def exhaustive_with_walks(situation: Situation, effort: Effort) -> Findings:
    """The same over walks, which may visit a station twice on each stretch: detours to a pad."""
    return _best_of_all(situation, effort, visits=2)


def _best_of_all(situation: Situation, effort: Effort, *, visits: int) -> Findings:
    situation.refuse_weather()
    whole = Subnetwork.whole(situation)
    best: Itinerary | None = None
    for order in permutations(situation.destinations):
        if effort.is_spent():
            break
        flights = stretches(situation, order, subnetwork=whole, approach=whole)
        start = situation.problem.start_station_id
        for route in _routes(start, flights, visits=visits, effort=effort):
            itinerary = fly(situation, route)
            effort.compositions += 1
            if is_better(situation, itinerary, best):
                best = itinerary
    return Findings(best, len(whole.stations))


def _routes(
    start: StationId, flights: Sequence[Stretch], *, visits: int, effort: Effort
) -> Iterator[Route]:
    """Every combination of paths through these stretches."""
    if not flights:
        yield ()
        return
    flight, *rest = flights
    for way in _ways(start, flight, visits=visits, effort=effort):
        leg = Leg(flight.target, flight.load_kg, way)
        for route in _routes(flight.target, rest, visits=visits, effort=effort):
            yield (leg, *route)


def _ways(
    start: StationId, flight: Stretch, *, visits: int, effort: Effort
) -> Iterator[tuple[Segment, ...]]:
    """Every path from start to target that visits each station at most `visits` times."""
    way: list[Segment] = []
    seen = Counter([start])
    branches = [iter(flight.subnetwork.segments_from(start))]
    while branches and not effort.is_spent():
        segment = next(branches[-1], None)
        if segment is None:
            branches.pop()
            if way:
                seen[way.pop().to_id] -= 1
            continue
        reached = segment.to_id
        if seen[reached] >= visits or reached in flight.keep_off:
            continue
        if reached == flight.target:
            yield (*way, segment)
            continue
        way.append(segment)
        seen[reached] += 1
        branches.append(iter(flight.subnetwork.segments_from(reached)))
