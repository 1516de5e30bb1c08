"""The least cost of the trips of drones, when each visit of a request earns the request's price.

This is the pricing problem of a Lagrangian relaxation. A drone flies one trip after another, and
may repeat a trip, though not immediately. Moments are those of the need (see `fleet_records`), in
buckets, rounded down. So the result is never more than the true least cost.
"""

from typing import NamedTuple

import numpy as np

from skyway.planner.kernels.compiler import array_kernel, entrance, kernel
from skyway.planner.kernels.memory import Floats, Longs, int64


class Nodes(NamedTuple):
    """Trips with their last place: a trip that may end at two places gives two nodes.

    - By node: `pool`, `source` (its number among all sources), `end` place, `least` ``(nodes, 3)``
      seconds, need and joules from the pickup to the end.
    - By node and member: `member`, -1 for none, and `served` ``(nodes, members, 2)``, seconds and
      need from the pickup until the member is served at the earliest.
    - By request: `weight`, `known_s`, `due_s`, and `price`, which each visit earns.
    - `rates`: the price of a second, of a second of lateness, of a joule.
    - `hand_over_s` between two trips.
    """

    pool: Longs
    source: Longs
    end: Longs
    least: Floats
    member: Longs
    served: Floats
    weight: Floats
    known_s: Floats
    due_s: Floats
    price: Floats
    rates: Floats
    hand_over_s: float


class Future(NamedTuple):
    """The least cost from a place and a bucket on, with the best next trip.

    The last axis holds the best trip, and the best trip of another pool.

    - `cost` ``(places, buckets + 1, 2)``, at most 0, and `first`, the next node, -1 to stop.
    - By source: `trip_cost` ``(sources, buckets + 1, 2)`` and `trip`, the node chosen, -1 for none.
    - `first_s` is the moment of bucket 0, `width_s` the width of a bucket.
    - No drone of need b has flown less than ``floor[0] + floor[1] * b`` seconds.
    """

    cost: Floats
    first: Longs
    trip_cost: Floats
    trip: Longs
    first_s: float
    width_s: float
    floor: Floats


@kernel
def trip_cost(nodes: Nodes, node: int, flown_s: float, charged_s: float) -> float:
    """The cost of a trip from these moments at the pickup, less the prices of its requests."""
    cost = nodes.rates[2] * nodes.least[node, 2]
    for number in range(nodes.member.shape[1]):
        request = nodes.member[node, number]
        if request < 0:
            break
        served = nodes.served[node, number]
        end_s = max(flown_s + served[0], charged_s + served[1])
        cost += nodes.weight[request] * (
            nodes.rates[0] * (end_s - nodes.known_s[request])
            + nodes.rates[1] * max(0.0, end_s - nodes.due_s[request])
        )
        cost -= nodes.price[request]
    return cost


@kernel
def _bucket(future: Future, moment_s: float) -> int:
    """The bucket of a moment; for all moments after the horizon the bucket after the last one."""
    last = future.cost.shape[1] - 1
    return max(int64(0), min(last, int64((moment_s - future.first_s) / future.width_s)))


@entrance
def fill_future(nodes: Nodes, approach: Floats, sources: Longs, future: Future) -> None:
    """Write the future of one drone model, from the last bucket to the first.

    Parameters
    ----------
    approach
        ``(places, places, 3)``: seconds, need and joules of the empty flight.
    sources
        The place of each source.
    """
    places, buckets = future.cost.shape[0], future.cost.shape[1] - 1
    later = _buckets_of(nodes, approach, sources, future)
    for bucket in range(buckets, -1, -1):
        charged_s = future.first_s + bucket * future.width_s
        flown_s = future.floor[0] + future.floor[1] * charged_s
        future.trip_cost[:, bucket] = np.inf
        future.trip[:, bucket] = -1
        if bucket < buckets:
            for node in range(nodes.pool.size):
                cost = trip_cost(nodes, node, flown_s, charged_s)
                cost += _least_after(nodes, future, node, min(buckets, bucket + later[1][node]))
                _note_trip(nodes, future, nodes.source[node], bucket, node, cost)
        for place in range(places):
            _fill_place(nodes, approach, sources, future, later[0], place, bucket)


@array_kernel
def _buckets_of(
    nodes: Nodes, approach: Floats, sources: Longs, future: Future
) -> tuple[Longs, Longs]:
    """The whole buckets of each approach, by place and source, and of each node."""
    width_s, most = future.width_s, future.cost.shape[1]
    away = np.empty((approach.shape[0], sources.size), np.int64)
    for place in range(approach.shape[0]):
        for source in range(sources.size):
            away[place, source] = min(most, int64(approach[place, sources[source], 1] / width_s))
    of_node = np.empty(nodes.pool.size, np.int64)
    for node in range(nodes.pool.size):
        of_node[node] = int64((nodes.least[node, 1] + nodes.hand_over_s) / width_s)
    return away, of_node


@kernel
def _fill_place(
    nodes: Nodes,
    approach: Floats,
    sources: Longs,
    future: Future,
    away: Longs,
    place: int,
    bucket: int,
) -> None:
    """Write the best next node of a place and the best one of another pool; stopping costs 0."""
    buckets = future.cost.shape[1] - 1
    best, second = 0.0, 0.0
    first, other = int64(-1), int64(-1)
    for source in range(sources.size):
        there = min(buckets, bucket + away[place, source])
        energy = nodes.rates[2] * approach[place, sources[source], 2]
        for turn in range(2):
            cost = future.trip_cost[source, there, turn] + energy
            if cost >= second:
                break
            node = future.trip[source, there, turn]
            is_other = first < 0 or nodes.pool[first] != nodes.pool[node]
            if cost < best:
                if is_other:
                    second, other = best, first
                best, first = cost, node
            elif is_other:
                second, other = cost, node
    future.cost[place, bucket, 0] = best
    future.cost[place, bucket, 1] = second
    future.first[place, bucket, 0] = first
    future.first[place, bucket, 1] = other


@kernel
def _least_after(nodes: Nodes, future: Future, node: int, bucket: int) -> float:
    """The least cost after this node, if the next trip is another trip."""
    place = nodes.end[node]
    first = future.first[place, bucket, 0]
    if first < 0:
        return 0.0
    if nodes.pool[first] != nodes.pool[node]:
        return future.cost[place, bucket, 0]
    return future.cost[place, bucket, 1]


@kernel
def _note_trip(
    nodes: Nodes, future: Future, source: int, bucket: int, node: int, cost: float
) -> None:
    """Keep the best node of a source and the best one of another pool."""
    if cost >= future.trip_cost[source, bucket, 1]:
        return
    first = future.trip[source, bucket, 0]
    is_other = first < 0 or nodes.pool[first] != nodes.pool[node]
    if cost < future.trip_cost[source, bucket, 0]:
        if is_other:
            future.trip_cost[source, bucket, 1] = future.trip_cost[source, bucket, 0]
            future.trip[source, bucket, 1] = first
        future.trip_cost[source, bucket, 0] = cost
        future.trip[source, bucket, 0] = node
    elif is_other:
        future.trip_cost[source, bucket, 1] = cost
        future.trip[source, bucket, 1] = node


@entrance
def least_walk(
    nodes: Nodes,
    approach: Floats,
    sources: Longs,
    future: Future,
    start: int,
    free_s: float,
    charged_s: float,
    depth: int,
    visits: Longs,
) -> float:
    """The least cost of one drone's trips, at most 0; adds their requests to `visits`.

    Parameters
    ----------
    charged_s
        The moment of its need: `free_s` less what its charge covers.
    depth
        1 or 2: the number of first trips that are computed with their own times, not by buckets.
    """
    least, first, second = 0.0, int64(-1), int64(-1)
    for one in range(nodes.pool.size):
        away = approach[start, sources[nodes.source[one]]]
        flown_s, need_s = free_s + away[0], charged_s + away[1]
        cost = trip_cost(nodes, one, flown_s, need_s) + nodes.rates[2] * away[2]
        flown_s += nodes.least[one, 0] + nodes.hand_over_s
        need_s += nodes.least[one, 1] + nodes.hand_over_s
        total = cost
        if depth == 1:
            total += _least_after(nodes, future, one, _bucket(future, need_s))
        if total < least:
            least, first, second = total, one, int64(-1)
        if depth == 1:
            continue
        for other in range(nodes.pool.size):
            if nodes.pool[other] == nodes.pool[one]:
                continue
            onward = approach[nodes.end[one], sources[nodes.source[other]]]
            total = cost + nodes.rates[2] * onward[2]
            total += trip_cost(nodes, other, flown_s + onward[0], need_s + onward[1])
            end_s = need_s + onward[1] + nodes.least[other, 1] + nodes.hand_over_s
            total += _least_after(nodes, future, other, _bucket(future, end_s))
            if total < least:
                least, first, second = total, one, other
    if first < 0:
        return 0.0
    node, moment_s, place = first, charged_s, start
    while node >= 0:
        for request in nodes.member[node]:
            if request >= 0:
                visits[request] += 1
        moment_s += approach[place, sources[nodes.source[node]], 1]
        moment_s += nodes.least[node, 1] + nodes.hand_over_s
        place = nodes.end[node]
        if second >= 0:
            node, second = second, int64(-1)
            continue
        bucket = _bucket(future, moment_s)
        following = future.first[place, bucket, 0]
        if following >= 0 and nodes.pool[following] == nodes.pool[node]:
            following = future.first[place, bucket, 1]
        node = following
        moment_s = future.first_s + bucket * future.width_s
    return least
