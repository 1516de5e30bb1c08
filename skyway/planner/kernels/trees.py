"""Reverse shortest-path trees, one for each destination, grown as far as the search asks.

All distances up to a tree's radius are final; beyond it the radius itself is a lower bound. An
indexed binary heap (Dijkstra with decrease-key) keeps what a tree will settle next.
"""

import numpy as np

from skyway.planner.kernels.compiler import entrance, kernel
from skyway.planner.kernels.memory import INWARD, Closed, Memory, Skyway
from skyway.planner.kernels.places import arcs_of, place_of

# How far a tree may grow on demand, as a multiple of the radius that it had to have.
_REACH = 2.0


@kernel
def plant(memory: Memory, tree: int, place: int) -> None:
    """Start a tree at its destination."""
    memory.distance[place, tree] = 0.0
    memory.radius[tree] = 0.0
    memory.tree_size[tree] = 0
    _lift(memory, tree, place)


@kernel
def grow(
    skyway: Skyway, closed: Closed, memory: Memory, tree: int, until_place: int, reach_m: float
) -> bool:
    """Grow until this place's distance is final, or all within this reach are.

    False when the memory is full; the tree can be grown on.
    """
    distance, heap = memory.distance, memory.tree_queue[tree]
    while memory.tree_size[tree] > 0:
        place = heap[0]
        here_m = distance[place, tree]
        memory.radius[tree] = here_m
        if place == until_place or here_m > reach_m:
            return True
        first = arcs_of(skyway, closed, memory, place, INWARD)
        if first < 0:
            return False
        _take_first(memory, tree)
        for arc in range(first, first + memory.arc_count[place, INWARD]):
            before = memory.arc_place[arc]
            length_m = here_m + memory.arc_length[arc]
            if length_m < distance[before, tree]:
                distance[before, tree] = length_m
                _lift(memory, tree, before)
    memory.radius[tree] = np.inf
    return True


@kernel
def _lift(memory, tree, place):
    """Put a place into the heap, or move it up after its distance fell."""
    heap, where = memory.tree_queue[tree], memory.tree_place[tree]
    distance = memory.distance
    slot = where[place]
    if slot < 0:
        slot = memory.tree_size[tree]
        memory.tree_size[tree] = slot + 1
    own = distance[place, tree]
    while slot > 0:
        above = (slot - 1) >> 1
        other = heap[above]
        if distance[other, tree] <= own:
            break
        heap[slot] = other
        where[other] = slot
        slot = above
    heap[slot] = place
    where[place] = slot


@kernel
def _take_first(memory, tree):
    """Take the nearest place out of the heap."""
    heap, where = memory.tree_queue[tree], memory.tree_place[tree]
    distance = memory.distance
    where[heap[0]] = -1
    size = memory.tree_size[tree] - 1
    memory.tree_size[tree] = size
    if size == 0:
        return
    moved = heap[size]
    own = distance[moved, tree]
    slot = 0
    while True:
        below = 2 * slot + 1
        if below >= size:
            break
        if below + 1 < size and distance[heap[below + 1], tree] < distance[heap[below], tree]:
            below += 1
        other = heap[below]
        if distance[other, tree] >= own:
            break
        heap[slot] = other
        where[other] = slot
        slot = below
    heap[slot] = moved
    where[moved] = slot


@entrance
def plant_all(
    skyway: Skyway, closed: Closed, memory: Memory, roots: np.ndarray, start: int, source: int
) -> bool:
    """Grow a tree from each root until it holds all other roots and the source.

    With more trees than destinations the last root is the source, and its tree is grown to the
    start. False when the memory is full; another call goes on. Afterwards `reach` says how far a
    tree may grow on demand: some way beyond what it had to hold.
    """
    for tree in range(roots.size):
        place = place_of(memory, np.int64(roots[tree]))
        if place < 0:
            return False
        if memory.radius[tree] < 0.0:
            plant(memory, tree, place)
        for other in range(roots.size + 1):
            target = source if other == roots.size else np.int64(roots[other])
            if roots[tree] == source and target != source:
                target = start
            until = place_of(memory, target)
            if until < 0:
                return False
            if memory.distance[until, tree] > memory.radius[tree] and not grow(
                skyway, closed, memory, tree, until, np.inf
            ):
                return False
        memory.reach[tree] = _REACH * memory.radius[tree]
    return True


@entrance
def distances(memory: Memory, roots: np.ndarray, source: int, count: int) -> np.ndarray:
    """From each destination, and at last from the source, to each destination, metres."""
    apart_m = np.empty((count + 1, count), np.float64)
    for row in range(count + 1):
        place = place_of(memory, source if row == count else np.int64(roots[row]))
        for tree in range(count):
            apart_m[row, tree] = memory.distance[place, tree]
    return apart_m
