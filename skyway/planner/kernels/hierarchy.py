"""Distances through a contraction hierarchy: built once for a network, then read without a search.

Stations are removed in the order of their rank. Each removed path is replaced by a shortcut between
the stations that remain. Then every shortest path climbs to some rank and comes down again, so a
station only needs the ranks above it (Dibbelt, Strasser and Wagner 2016, "Customizable contraction
hierarchies").
"""

import numpy as np

from skyway.planner.kernels.compiler import entrance, kernel
from skyway.planner.kernels.memory import Floats, Ints, Longs, Memory, int64
from skyway.planner.kernels.records import Skyway


@entrance
def shortcuts(skyway: Skyway, rank: Longs) -> tuple[Longs, Longs]:
    """The ranks above each rank: offsets ``(n + 1,)`` by rank, and the ranks above, ascending.

    Once a rank is removed, all ranks above it are connected, so the others are above the lowest.
    """
    count = rank.size
    row_at = np.empty(count, np.int64)
    row_at[rank] = np.arange(count)
    offsets = np.zeros(count + 1, np.int64)
    above = np.empty(16 * count + 16, np.int64)
    first_child = np.full(count, -1, np.int64)
    next_child = np.full(count, -1, np.int64)
    seen = np.full(count, -1, np.int64)
    found = np.empty(count, np.int64)
    for own in range(count):
        row = row_at[own]
        size = int64(0)
        for index in range(skyway.out_offsets[row], skyway.out_offsets[row + 1]):
            size = _add(found, size, seen, own, rank[skyway.out_station[index]])
        for index in range(skyway.in_offsets[row], skyway.in_offsets[row + 1]):
            size = _add(found, size, seen, own, rank[skyway.in_station[index]])
        child = first_child[own]
        while child >= 0:
            for index in range(offsets[child], offsets[child + 1]):
                size = _add(found, size, seen, own, above[index])
            child = next_child[child]
        first = offsets[own]
        if first + size > above.size:
            larger = np.empty(2 * above.size + size, np.int64)
            larger[:first] = above[:first]
            above = larger
        above[first : first + size] = np.sort(found[:size])
        offsets[own + 1] = first + size
        if size > 0:
            parent = above[first]
            next_child[own] = first_child[parent]
            first_child[parent] = own
    return offsets, above[: offsets[count]].copy()


@kernel
def _add(found: Longs, size: int, seen: Longs, own: int, other: int) -> int:
    if other > own and seen[other] != own:
        seen[other] = own
        found[size] = other
        return size + 1
    return size


@entrance
def shortcut_lengths(
    skyway: Skyway, rank: Longs, offsets: Longs, above: Longs
) -> tuple[Floats, Floats]:
    """The length of each shortcut up and down, metres; inf where there is no way."""
    up = np.full(above.size, np.inf)
    down = np.full(above.size, np.inf)
    for row in range(rank.size):
        for index in range(skyway.out_offsets[row], skyway.out_offsets[row + 1]):
            here, there = rank[row], rank[int64(skyway.out_station[index])]
            length_m = skyway.out_length[index]
            if here < there:
                place = _place_of(offsets, above, here, there)
                up[place] = min(up[place], length_m)
            else:
                place = _place_of(offsets, above, there, here)
                down[place] = min(down[place], length_m)
    for own in range(rank.size):
        end = offsets[own + 1]
        for first in range(offsets[own], end):
            place = offsets[above[first]]
            for second in range(first + 1, end):
                while above[place] < above[second]:
                    place += 1
                up[place] = min(up[place], down[first] + up[second])
                down[place] = min(down[place], down[second] + up[first])
    return up, down


@kernel
def _place_of(offsets: Longs, above: Longs, low: int, high: int) -> int:
    return offsets[low] + np.searchsorted(above[offsets[low] : offsets[low + 1]], high)


@entrance
def root_all(skyway: Skyway, memory: Memory, roots: Ints) -> None:
    """Note the distances from all ranks above this one to each root, on paths that only go down."""
    for tree in range(roots.size):
        own = skyway.rank[roots[tree]]
        while own >= 0:
            _touch(memory, own)
            own = _parent(skyway, own)
        own = skyway.rank[roots[tree]]
        memory.rank_distance[own, tree] = 0.0
        while own >= 0:
            here_m = memory.rank_distance[own, tree]
            for index in range(skyway.above_offsets[own], skyway.above_offsets[own + 1]):
                other = skyway.above[index]
                length_m = skyway.down_length[index] + here_m
                if length_m < memory.rank_distance[other, tree]:
                    memory.rank_distance[other, tree] = length_m
            own = _parent(skyway, own)


@kernel
def measure(skyway: Skyway, memory: Memory, place: int) -> None:
    """Note the distance from this place to every root, after those of all ranks above it."""
    own = skyway.rank[memory.row[place]]
    height = 0
    while own >= 0 and memory.rank_known[own] != _MEASURED:
        _touch(memory, own)
        memory.climb[height] = own
        height += 1
        own = _parent(skyway, own)
    distance, known, trees = memory.rank_distance, memory.rank_known, memory.radius.shape[0]
    above, up_length = skyway.above, skyway.up_length
    while height > 0:
        height -= 1
        own = memory.climb[height]
        for index in range(skyway.above_offsets[own], skyway.above_offsets[own + 1]):
            other, length_m = above[index], up_length[index]
            for tree in range(trees):
                distance[own, tree] = min(distance[own, tree], length_m + distance[other, tree])
        known[own] = _MEASURED
    own = skyway.rank[memory.row[place]]
    for tree in range(trees):
        memory.distance[tree, place] = distance[own, tree]


# The distances found for a rank so far: none, those on paths down, or all.
_TOUCHED = 1
_MEASURED = 2


@kernel
def _touch(memory: Memory, own: int) -> None:
    if memory.rank_known[own] == 0:
        memory.rank_known[own] = _TOUCHED
        for tree in range(memory.radius.shape[0]):
            memory.rank_distance[own, tree] = np.inf


@kernel
def _parent(skyway: Skyway, own: int) -> int:
    """The lowest rank above; -1 at the top."""
    first = skyway.above_offsets[own]
    return skyway.above[first] if first < skyway.above_offsets[own + 1] else -1
