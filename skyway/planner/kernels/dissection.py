"""The order in which a hierarchy removes stations: nested dissection by their positions.

A cut through the middle splits the stations into two halves. The stations on one side of the cut
with neighbours on the other side come last. Then each half is cut again.
"""

import numpy as np

from skyway.planner.kernels.compiler import array_kernel, entrance, kernel
from skyway.planner.kernels.memory import Floats, Longs, int64
from skyway.planner.kernels.records import Skyway

#: Halves this small are not cut again.
_SMALL = 4


@entrance
def dissected(skyway: Skyway, x: Floats, y: Floats) -> Longs:
    """The rank of each station, ``(n_stations,)``: higher ranks separate lower ones."""
    count = x.size
    rows = np.arange(count)
    rank = np.empty(count, np.int64)
    side = np.full(count, -1, np.int64)
    todo = [(int64(0), int64(count), int64(count))]
    cuts = 0
    while len(todo) > 0:
        low, high, rank_end = todo.pop()
        if high - low <= _SMALL:
            for index in range(low, high):
                rank_end -= 1
                rank[rows[index]] = rank_end
            continue
        part = rows[low:high].copy()
        across = x if _spread(x, part) > _spread(y, part) else y
        part = part[np.argsort(across[part])]
        middle = (high - low) // 2
        side[part[:middle]] = 2 * cuts
        side[part[middle:]] = 2 * cuts + 1
        near = _at_cut(skyway, side, part[:middle], 2 * cuts + 1)
        far = _at_cut(skyway, side, part[middle:], 2 * cuts)
        separator = near if near.size <= far.size else far
        side[separator] = -1
        for index in range(separator.size):
            rank_end -= 1
            rank[separator[index]] = rank_end
        left_end = _collect(rows, low, part, side, 2 * cuts)
        right_end = _collect(rows, left_end, part, side, 2 * cuts + 1)
        todo.append((low, left_end, rank_end - (right_end - left_end)))
        todo.append((left_end, right_end, rank_end))
        cuts += 1
    return rank


@array_kernel
def _spread(values: Floats, part: Longs) -> float:
    chosen = values[part]
    return chosen.max() - chosen.min()


@array_kernel
def _at_cut(skyway: Skyway, side: Longs, part: Longs, other_side: int) -> Longs:
    """The stations of this part with a segment from or to the other side."""
    found = np.empty(part.size, np.int64)
    count = 0
    for row in part:
        touches = False
        for index in range(skyway.out_offsets[row], skyway.out_offsets[row + 1]):
            touches = touches or side[skyway.out_station[index]] == other_side
        for index in range(skyway.in_offsets[row], skyway.in_offsets[row + 1]):
            touches = touches or side[skyway.in_station[index]] == other_side
        if touches:
            found[count] = row
            count += 1
    return found[:count].copy()


@kernel
def _collect(rows: Longs, low: int, part: Longs, side: Longs, which: int) -> int:
    """Write the stations of one side from `low` on; returns the index after the last one."""
    end = low
    for row in part:
        if side[row] == which:
            rows[end] = row
            end += 1
    return end
