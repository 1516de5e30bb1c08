"""Lower bounds of the remaining work: the time in the air, and the need to charge.

Where every session charges to the top, a need is counted in joules. Otherwise it is counted in
seconds of flying and of charging each joule at the fastest rate of the curve. The need does not
count the charge on board: each label subtracts its own charge.
"""

import numpy as np

from skyway.planner.kernels.compiler import entrance, kernel
from skyway.planner.kernels.hierarchy import measure
from skyway.planner.kernels.memory import NONE, Floats, Ints, Memory, int64
from skyway.planner.kernels.records import Search
from skyway.planner.kernels.trees import grow


@entrance
def fill_orders(
    apart_m: Floats,
    required: Ints,
    weight: Floats,
    per_stop: float,
    at_end: Floats,
    after: Floats,
) -> float:
    """The least cost after each destination, over all orders of the others (Held and Karp).

    Parameters
    ----------
    apart_m
        ``(k + 1, k)``, from destination to destination; the last row is from the source.
    required
        ``(k,)``: the destinations that must be delivered before this one, as a mask.
    weight
        ``(2**k,)``: seconds per metre with the packages on board.
    per_stop, at_end
        Seconds of each delivery, and seconds at the end if this destination is the last.
    after
        ``(2**k, k)``, written: the least cost after destination j, once `mask` is delivered.

    Returns
    -------
    float
        The least cost from the source with all packages on board.
    """
    count = at_end.size
    full = (1 << count) - 1
    for mask in range(full, -1, -1):
        for reached in range(count):
            if mask >> reached & 1 or mask & required[reached] != required[reached]:
                after[mask, reached] = np.inf
                continue
            following = mask | 1 << reached
            least = at_end[reached] if following == full else np.inf
            for onward in range(count):
                if not following >> onward & 1 and apart_m[reached, onward] < np.inf:
                    total = apart_m[reached, onward] * weight[following] + after[following, onward]
                    least = min(least, total)
            after[mask, reached] = per_stop + least
    least = np.inf if count > 0 else 0.0
    for onward in range(count):
        if apart_m[count, onward] < np.inf:
            least = min(least, apart_m[count, onward] * weight[0] + after[0, onward])
    return least


@kernel
def note_bounds(search: Search, state: int, place: int, mask: int) -> bool:
    """Note both bounds of a state, growing the trees that decide them; False when full."""
    skyway, task, closed, memory = search.skyway, search.task, search.closed, search.memory
    count = task.destinations.size
    if skyway.rank.size > 0:
        measure(skyway, memory, place)
    if mask == 1 << count:
        return _note_approach(search, state, place)
    while True:
        flight_s, need = np.inf, np.inf
        nearest, cheapest = NONE, NONE
        for onward in range(count):
            if task.flight_after[mask, onward] == np.inf:
                continue
            tree = memory.tree_of[onward]
            length_m = min(memory.distance[tree, place], memory.radius[tree])
            if length_m == np.inf:
                continue
            total = length_m * task.flight_s_per_m[mask] + task.flight_after[mask, onward]
            if total < flight_s:
                flight_s, nearest = total, onward
            total = length_m * task.need_per_m[mask] + task.need_after[mask, onward]
            if total < need:
                need, cheapest = total, onward
        onward = nearest
        if onward < 0 or not _can_grow(memory, memory.tree_of[onward], place):
            onward = cheapest
        if onward < 0 or not _can_grow(memory, memory.tree_of[onward], place):
            memory.state_bound[state, 0] = flight_s
            memory.state_bound[state, 1] = need
            return True
        tree = memory.tree_of[onward]
        if not grow(skyway, closed, memory, tree, place, memory.reach[tree]):
            return False


@kernel
def _note_approach(search: Search, state: int, place: int) -> bool:
    """Note both bounds of a state on the approach, from the source's tree; False when full."""
    task, memory = search.task, search.memory
    count = int64(task.destinations.size)
    mask = 1 << count
    tree = memory.tree_of[count]
    if _can_grow(memory, tree, place) and not grow(
        search.skyway, search.closed, memory, tree, place, memory.reach[tree]
    ):
        return False
    length_m = min(memory.distance[tree, place], memory.radius[tree])
    if length_m == np.inf:
        memory.state_bound[state, 0] = np.inf
        memory.state_bound[state, 1] = np.inf
        return True
    memory.state_bound[state, 0] = length_m * task.flight_s_per_m[mask] + task.approach_flight_after
    memory.state_bound[state, 1] = length_m * task.need_per_m[mask] + task.approach_need_after
    return True


@kernel
def _can_grow(memory: Memory, tree: int, place: int) -> bool:
    """Whether this place lies beyond the tree, and the tree may still grow."""
    return (
        memory.distance[tree, place] > memory.radius[tree]
        and memory.radius[tree] <= memory.reach[tree]
    )


@entrance
def fill_floors(after: Floats, first_start_s: Floats, floor_s: Floats) -> None:
    """Write the least end of the last delivery that the windows allow, by mask.

    Parameters
    ----------
    after
        ``(2**k, k)`` seconds from the start of a hand-over to the end, see `fill_orders`.
    first_start_s
        ``(k,)``, the first moment at which each hand-over may begin.
    floor_s
        ``(2**k + 1,)``, written up to the last but one.
    """
    count = first_start_s.size
    full = (1 << count) - 1
    floor_s[full] = -np.inf
    for mask in range(full - 1, -1, -1):
        least_s = np.inf
        for number in range(count):
            if mask >> number & 1:
                continue
            end_s = max(first_start_s[number] + after[mask, number], floor_s[mask | 1 << number])
            least_s = min(least_s, end_s)
        floor_s[mask] = least_s


@kernel
def note_last_arrival(search: Search, state: int, place: int, mask: int) -> None:
    """Note the moment after which a drone here is too late for some pickup or hand-over."""
    task, memory = search.task, search.memory
    count = int64(task.destinations.size)
    latest_s = np.inf
    is_approach = mask == int64(1) << count
    for act in range(count + 1):
        is_due = is_approach if act == count else not is_approach and not mask >> act & 1
        if is_due and task.last_start_s[act] < np.inf:
            tree = memory.tree_of[act]
            length_m = min(memory.distance[tree, place], memory.radius[tree])
            last_s = task.last_start_s[act] - length_m * task.least_s_per_m[mask]
            latest_s = min(latest_s, last_s)
    memory.state_bound[state, 2] = latest_s
