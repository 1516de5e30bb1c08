"""Reverse shortest-path trees, one for each destination, grown as far as the search needs.

All distances up to a tree's radius are final; beyond it the radius itself is a lower bound. An
indexed heap of four branches (Dijkstra with decrease-key) holds the places that a tree settles
next.
"""

import numpy as np

from skyway.planner.kernels.compiler import entrance, fetch_soon, kernel
from skyway.planner.kernels.hierarchy import measure
from skyway.planner.kernels.memory import INWARD, PLACES, Floats, Ints, Longs, Memory, int64
from skyway.planner.kernels.places import arcs_of, place_of
from skyway.planner.kernels.records import Closed, Skyway
from skyway.planner.kernels.weather import has_weather

# How far a tree may grow on demand, as a multiple of the radius that it needed first.
REACH = 2.0


@kernel
def plant(memory: Memory, tree: int, place: int) -> None:
    """Start a tree at its destination."""
    memory.distance[tree, place] = 0.0
    memory.radius[tree] = 0.0
    keys, heap, slots = memory.tree_key[tree], memory.tree_heap[tree], memory.tree_slot[tree]
    memory.tree_size[tree] = _lift(keys, heap, slots, int64(0), place, 0.0)


@kernel
def grow(
    skyway: Skyway, closed: Closed, memory: Memory, tree: int, until_place: int, reach_m: float
) -> bool:
    """Grow until the distance of this place, or of all places within this reach, is final.

    False when the memory is full; a later call can continue.
    """
    distance = memory.distance[tree]
    keys, heap, slots = memory.tree_key[tree], memory.tree_heap[tree], memory.tree_slot[tree]
    arc_place, arc_length, arc_count = memory.arc_place, memory.arc_length, memory.arc_count
    size = memory.tree_size[tree]
    radius_m = memory.radius[tree]
    is_full = False
    while size > 0:
        place, radius_m = heap[0], keys[0]
        if place == until_place or radius_m > reach_m:
            break
        first = arcs_of(skyway, closed, memory, place, INWARD)
        if first < 0:
            is_full = True
            break
        size = _without_first(keys, heap, slots, size)
        for arc in range(first, first + arc_count[place, INWARD]):
            before = arc_place[arc]
            length_m = radius_m + arc_length[arc]
            if length_m < distance[before]:
                _fetch_arcs(skyway, memory, before)
                distance[before] = length_m
                size = _lift(keys, heap, slots, size, before, length_m)
    memory.tree_size[tree] = size
    memory.radius[tree] = radius_m if size > 0 else np.inf
    return not is_full


@kernel
def _fetch_arcs(skyway: Skyway, memory: Memory, place: int) -> None:
    """Fetch the segments that arrive at a place, which are read when a tree settles this place.

    On a network of a million stations the processor would wait longest for them.
    """
    if memory.arc_first[place, INWARD] < 0:
        first = skyway.in_offsets[memory.row[place]]
        fetch_soon(skyway.in_station, first)
        fetch_soon(skyway.in_segment, first)
        fetch_soon(skyway.in_length, first)


@kernel
def _lift(keys: Floats, heap: Longs, slots: Longs, size: int, place: int, length_m: float) -> int:
    """Put a place into the heap, or move it up after its distance fell; the heap's size."""
    slot = slots[place]
    if slot < 0:
        slot = size
        size += 1
    while slot > 0:
        above = (slot - 1) >> 2
        if keys[above] <= length_m:
            break
        keys[slot] = keys[above]
        heap[slot] = heap[above]
        slots[heap[slot]] = slot
        slot = above
    keys[slot] = length_m
    heap[slot] = place
    slots[place] = slot
    return size


@kernel
def _without_first(keys: Floats, heap: Longs, slots: Longs, size: int) -> int:
    """Take the nearest place out of the heap; the heap's size."""
    slots[heap[0]] = -1
    size -= 1
    if size == 0:
        return 0
    length_m, place = keys[size], heap[size]
    slot = 0
    while True:
        first = 4 * slot + 1
        if first >= size:
            break
        below = first
        for other in range(first + 1, min(first + 4, size)):
            if keys[other] < keys[below]:
                below = other
        if keys[below] >= length_m:
            break
        keys[slot] = keys[below]
        heap[slot] = heap[below]
        slots[heap[slot]] = slot
        slot = below
    keys[slot] = length_m
    heap[slot] = place
    slots[place] = slot
    return size


@entrance
def plant_all(
    skyway: Skyway, closed: Closed, memory: Memory, roots: Ints, start: int, source: int
) -> bool:
    """Grow a tree from each root, until `distances` can find how far apart the roots are.

    A tree grows until it holds all other roots and the source. The source alone is enough where
    each way back is as long as the way there, because then any two trees meet. With more trees
    than destinations the last root is the source, and its tree is grown to the start. False when
    the memory is full; another call continues.
    """
    is_two_way = _is_two_way(skyway, closed)
    for tree in range(roots.size):
        place = place_of(memory, int64(roots[tree]))
        if place < 0:
            return False
        if memory.radius[tree] < 0.0:
            plant(memory, tree, place)
        for other in range(roots.size + 1):
            target = source if other == roots.size or is_two_way else int64(roots[other])
            if roots[tree] == source:
                target = start
            until = place_of(memory, target)
            if until < 0:
                return False
            if memory.distance[tree, until] > memory.radius[tree] and not grow(
                skyway, closed, memory, tree, until, np.inf
            ):
                return False
        memory.reach[tree] = REACH * memory.radius[tree]
    return True


@kernel
def _is_two_way(skyway: Skyway, closed: Closed) -> bool:
    """Whether each way back is as long as the way there, for this request."""
    return skyway.is_two_way and closed.is_two_way and not has_weather(skyway)


@entrance
def distances(
    skyway: Skyway, closed: Closed, memory: Memory, roots: Ints, source: int, count: int
) -> Floats:
    """Metres from each destination, and last from the source, to each destination.

    Also sets `reach`, how far a tree may grow on demand: somewhat further than these distances. The
    result means nothing if the memory is full afterwards.
    """
    apart_m = np.empty((count + 1, count), np.float64)
    for row in range(count + 1):
        place = place_of(memory, source if row == count else int64(roots[row]))
        if skyway.rank.size > 0:
            measure(skyway, memory, place)
        for number in range(count):
            tree = memory.tree_of[number]
            length_m = memory.distance[tree, place]
            if length_m > memory.radius[tree]:
                length_m = _through_both(skyway, closed, memory, tree, memory.tree_of[row])
            apart_m[row, number] = length_m
            memory.reach[tree] = max(memory.reach[tree], REACH * length_m)
    return apart_m


@kernel
def _through_both(skyway: Skyway, closed: Closed, memory: Memory, tree: int, other: int) -> float:
    """Metres between the roots of two trees that hold a common place; a two-way network's only.

    Adds the segments in the order in which the first tree would add them if it grew to the other's
    root, so that no rounding differs.
    """
    least_m, place = np.inf, int64(0)
    for common in range(memory.counts[PLACES]):
        length_m = memory.distance[tree, common] + memory.distance[other, common]
        if length_m < least_m:
            least_m, place = length_m, int64(common)
    if least_m == np.inf:
        return least_m
    distance = memory.distance[other]
    length_m = memory.distance[tree, place]
    while distance[place] > 0.0:
        first = arcs_of(skyway, closed, memory, place, INWARD)
        if first < 0:
            return np.inf
        arc = first
        while distance[memory.arc_place[arc]] + memory.arc_length[arc] != distance[place]:
            arc += 1
        length_m += memory.arc_length[arc]
        place = memory.arc_place[arc]
    return length_m
