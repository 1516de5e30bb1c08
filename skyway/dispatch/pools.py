"""Which requests may share a trip, and where it may be loaded.

A set of requests may share a trip only if each two of them may. So larger sets are made from pairs,
as in Alonso-Mora, Samaranayake, Wallar, Frazzoli and Rus (2017).
"""

from collections.abc import Iterable, Iterator, Sequence
from functools import reduce
from itertools import chain, combinations, islice, product
from operator import and_, or_
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from skyway.dispatch.planned_trip import Pool
from skyway.dispatch.problem import MAX_DESTINATIONS, FleetProblem, FleetRequest
from skyway.geo import EARTH_RADIUS_M
from skyway.ids import DroneId, StationId
from skyway.network.great_circle import unit_vectors
from skyway.network.network import Network
from skyway.planner.kernels.memory import Floats, Longs
from skyway.units import LOAD_TOLERANCE_KG

#: The most shared trips that are estimated; each pickup of a set of requests counts. Our own
#: choice: their estimates take one to three seconds.
_MOST_TRIPS: Final = 20_000

#: The search loads a shared trip at one of so many common stations. Our own choice.
_MOST_PICKUPS: Final = 3

#: So many sets are read together. Our own choice.
_BLOCK: Final = 1_000

#: The most destinations of a shared trip. Our own choice: with more, estimates and plans are slow.
_MOST_DESTINATIONS: Final = min(6, MAX_DESTINATIONS)


def pickups_of(requests: Sequence[FleetRequest]) -> tuple[StationId, ...]:
    """The stations where a trip of these requests may be loaded; none if they may not share it.

    A request alone is picked up at its source.
    """
    first, *others = requests
    if not others:
        return (first.source,)
    common = set(first.pickups) | {first.source}
    for each in others:
        common &= {each.source, *each.pickups}
    return tuple(each for each in (first.source, *first.pickups) if each in common)


class SharedPools(NamedTuple):
    """Sets of two and more requests that may share a trip, small sets first.

    `is_complete` says that these are all such sets.
    """

    pools: list[Pool]
    is_complete: bool


class Sharing:
    """Which requests of a problem may share trips, and from where."""

    def __init__(self, problem: FleetProblem) -> None:
        self._problem = problem
        requests = problem.requests
        self._places = [*dict.fromkeys(chain.from_iterable(map(_stations_of, requests)))]
        place_of = {each: number for number, each in enumerate(self._places)}
        self._apart_m = _apart_m(problem.network, self._places)
        most_kg = max(each.model.max_payload_kg for each in problem.drones)
        self._limit_kg = most_kg + LOAD_TOLERANCE_KG
        self._masses_kg = [each.mass_kg for each in requests]
        self._ends = [
            list(dict.fromkeys(place_of[one.destination] for one in each.packages))
            for each in requests
        ]
        self._pickups = [
            [place_of[one] for one in (each.source, *each.pickups)] for each in requests
        ]
        # Bits of one number are compared faster than sets.
        self._end_bits = [_bits(each) for each in self._ends]
        self._pickup_bits = [
            _bits(places) if each.pooling else 0
            for each, places in zip(requests, self._pickups, strict=True)
        ]

    def allows(self, pool: Pool) -> bool:
        """Whether these requests may have one trip.

        Requests that share a trip allow pooling and have a common pickup, and the strongest drone
        model of the fleet can lift them together. The planner checks their windows later.
        """
        return len(pool) == 1 or (len(pool) <= self._problem.most_pooled and self._may_share(pool))

    def pools(self, *, most_trips: int = _MOST_TRIPS) -> SharedPools:
        """Sets of requests that may share a trip, and those that share one in the current plan.

        If there are too many trips, each size keeps a part of its sets. The best set of each
        request is kept before any second best set. The best sets have the least detour.
        """
        most = most_trips // min(_MOST_PICKUPS, max(map(len, self._pickups), default=1))
        levels, is_complete = list[list[Pool]](), True
        detour_m = self._detours_m()
        larger = np.argwhere(np.triu(np.isfinite(detour_m), 1))
        is_pair = np.zeros(detour_m.shape, np.bool_)
        for size in range(2, self._problem.most_pooled + 1):
            found = self._best(larger, detour_m, most=most + 1)
            is_complete &= len(found) <= most
            levels.append(found[:most])
            level = np.array(levels[-1], np.int64).reshape(-1, size)
            if size == 2:
                is_pair[level[:, 0], level[:, 1]] = is_pair[level[:, 1], level[:, 0]] = True
            larger = _enlarged(level, is_pair)
        parts = _parts([len(each) for each in levels], most)
        is_complete &= parts == [len(each) for each in levels]
        kept = {*chain(*(each[:part] for each, part in zip(levels, parts, strict=True)))}
        kept.update(
            each
            for each in planned_trips(self._problem).values()
            if len(each) > 1 and self.allows(each)
        )
        return SharedPools(sorted(kept, key=lambda each: (len(each), each)), is_complete)

    def pickups(self, pool: Pool) -> tuple[StationId, ...]:
        """The stations where the search loads a trip of these requests.

        If they have many common stations, these are the nearest to the destinations.
        """
        places = self._pickups[pool[0]]
        if len(pool) == 1:
            return (self._places[places[0]],)
        common = self._common(pool)
        places = [each for each in places if common >> each & 1]
        if len(places) > _MOST_PICKUPS:
            ends = [one for each in pool for one in self._ends[each]]
            away_m = self._apart_m[np.ix_(places, ends)].sum(axis=1)
            nearest = np.argsort(away_m, kind="stable")[:_MOST_PICKUPS]
            places = [places[each] for each in nearest.tolist()]
        return tuple(self._places[each] for each in places)

    def _common(self, pool: Pool) -> int:
        """The common pickups of these requests, as bits."""
        return reduce(and_, (self._pickup_bits[each] for each in pool))

    def _may_share(self, pool: Pool) -> bool:
        if self._common(pool) == 0 or sum(self._masses_kg[each] for each in pool) > self._limit_kg:
            return False
        ends = reduce(or_, (self._end_bits[each] for each in pool))
        return ends.bit_count() <= _MOST_DESTINATIONS

    def _detours_m(self) -> Floats:
        """``(requests, requests)``: the detour of each pair; inf if they have no common pickup.

        The detour is how much longer the way of both is than the longer way of one of them, in
        straight lines from their sources.
        """
        named = np.zeros((len(self._pickups), len(self._places)), np.float32)
        for number, (places, bits) in enumerate(zip(self._pickups, self._pickup_bits, strict=True)):
            named[number, places] = bits > 0
        alone_m = np.array(
            [
                self._apart_m[places[0], ends].max()
                for places, ends in zip(self._pickups, self._ends, strict=True)
            ]
        )
        # A request with more destinations shares no trip.
        width = min(_MOST_DESTINATIONS, max(map(len, self._ends), default=1))
        ends = np.array([(each * width)[:width] for each in self._ends], np.int64)
        between_m = np.full((len(ends), len(ends)), np.inf)
        for one, other in product(ends.reshape(-1, width).T, repeat=2):
            np.minimum(between_m, self._apart_m[np.ix_(one, other)], out=between_m)
        shorter_m, longer_m = np.minimum.outer(alone_m, alone_m), np.maximum.outer(alone_m, alone_m)
        return np.where(named @ named.T > 0, shorter_m + between_m - longer_m, np.inf)

    def _best(self, pools: Longs, detour_m: Floats, *, most: int) -> list[Pool]:
        """Those of these sets that may share a trip, the best ones first.

        The detour of a set is the sum of the detours of its pairs.
        """
        detours_m = np.zeros(len(pools))
        for one, other in combinations(range(pools.shape[1]), 2):
            detours_m += detour_m[pools[:, one], pools[:, other]]
        best = _by_block(pools, _best_first(pools, detours_m))
        return list(islice(filter(self._may_share, best), most))


def waits_for_more(problem: FleetProblem, pool: Pool, *, most_wait_s: float) -> bool:
    """Whether a trip of these requests waits for other requests that may share it.

    It waits until it has as many requests as may share a trip, or until its oldest request is so
    old. The search knows no future requests, so the caller asks this before it begins a trip.
    """
    requests = [problem.requests[each] for each in pool]
    return (
        len(pool) < problem.most_pooled
        and all(each.pooling for each in requests)
        and min(each.known_s for each in requests) > -most_wait_s
    )


def planned_trips(problem: FleetProblem) -> dict[tuple[DroneId, float], Pool]:
    """The trips of the current plan by their drone and start."""
    trips: dict[tuple[DroneId, float], Pool] = {}
    for number, request in enumerate(problem.requests):
        if request.planned is not None:
            key = request.planned.drone_id, request.planned.start_s
            trips[key] = (*trips.get(key, ()), number)
    return trips


def _enlarged(level: Longs, is_pair: npt.NDArray[np.bool_]) -> Longs:
    """The sets with one more request of a higher number, if each two of them are a pair."""
    joins = np.ones((len(level), len(is_pair)), np.bool_)
    for members in level.T:
        joins &= is_pair[members]
    joins &= np.arange(len(is_pair)) > level[:, -1:]
    rows, added = np.nonzero(joins)
    return np.column_stack((level[rows], added))


def _best_first(pools: Longs, detours_m: Floats) -> Longs:
    """The order of these sets: the best set of each request, then the second best, and so on."""
    members, of_member = pools.ravel(), np.repeat(detours_m, pools.shape[1])
    order = np.lexsort((of_member, members))
    first = np.searchsorted(members[order], members[order])
    place = np.empty(len(order), np.int64)
    place[order] = np.arange(len(order)) - first
    return np.lexsort((detours_m, place.reshape(pools.shape).min(axis=1)))


def _by_block(pools: Longs, order: Longs) -> Iterator[Pool]:
    """These sets in this order; a caller that stops early reads only a part of them."""
    for first in range(0, len(order), _BLOCK):
        yield from map(tuple, pools[order[first : first + _BLOCK]].tolist())


def _parts(counts: Sequence[int], most: int) -> list[int]:
    """How many of each count are kept: the same number of each, or all of small counts."""
    parts, left = [0] * len(counts), most
    for done, each in enumerate(sorted(range(len(counts)), key=counts.__getitem__)):
        parts[each] = min(counts[each], left // (len(counts) - done))
        left -= parts[each]
    return parts


def _stations_of(request: FleetRequest) -> Iterable[StationId]:
    return (request.source, *request.pickups, *(each.destination for each in request.packages))


def _bits(numbers: Iterable[int]) -> int:
    """These numbers as the bits of one number."""
    bits = 0
    for each in numbers:
        bits |= 1 << each
    return bits


def _apart_m(network: Network, places: Sequence[StationId]) -> Floats:
    """``(places, places)``: straight lines between places, whole metres.

    Whole metres are the same on every machine.
    """
    rows = [network.row_of[each] for each in places]
    columns = network.columns
    at = unit_vectors(columns.longitude_deg[rows], columns.latitude_deg[rows])
    squares = sum((at[:, axis, None] - at[:, axis]) ** 2 for axis in range(3))
    return np.rint(EARTH_RADIUS_M * np.sqrt(squares))
