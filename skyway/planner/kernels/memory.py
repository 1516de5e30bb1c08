"""The memory of a search, and the meaning of its numbers.

A *place* is a station that the search has met, numbered in the order of meeting. All notes are kept
by place, so the cost of a search depends on the reach of the request, not on the network's size.
A *mask* is a set of delivered destinations, bit by bit; the mask ``2**k`` stands for the approach,
with no package on board yet.
"""

from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Singles = npt.NDArray[np.float32]
Ints = npt.NDArray[np.int32]
Longs = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]

#: The int type of the kernels. A plain 0, or an element of `Ints`, has another type for numba,
#: which would compile the kernel again.
int64: Callable[[Any], int] = np.int64  # type: ignore[assignment]  # no int for mypy

#: No label, segment or landing.
NONE: Final = int64(-1)

# Columns of `Memory.arc_first` and `Memory.arc_count`: arcs that arrive and arcs that leave.
INWARD: Final = int64(0)
OUTWARD: Final = int64(1)

# Rows of `Memory.counts`: how much of each array is in use, and whether one is full. `STALE` counts
# the windows that are out of date because reservations of their station have changed.
PLACES: Final = 0
ARCS: Final = 1
WINDOWS: Final = 2
STATES: Final = 3
LABELS: Final = 4
QUEUE: Final = 5
FULL: Final = 6
SEARCHED: Final = 7
BEST: Final = 8
TREES: Final = 9
STALE: Final = 10

# How a label was made.
START: Final = int64(0)
FLOWN: Final = int64(1)
LANDED: Final = int64(2)
SESSION: Final = int64(3)
HANDED_OVER: Final = int64(4)
# Picked up or handed over by a drone that stood there already.
STAYED: Final = int64(5)

# Columns of `Memory.label`.
TIME: Final = 0
POSITION: Final = 1
LEVEL: Final = 2
LAST_POSITION: Final = 3
LAST_LEVEL: Final = 4
USED: Final = 5
LATEST: Final = 6
# Columns of `Memory.next_label` and `Memory.most_before_j`, which are the same memory, in 4 bytes.
NEXT: Final = 14
MOST_BEFORE: Final = 15

# Columns of `Memory.link`.
PARENT: Final = 0
STATE: Final = 1
KIND: Final = 2
DETAIL: Final = 3
ALIVE: Final = 4

# Values of the column `ALIVE`, beside 0.
NEW: Final = int64(1)
WITH_PERIOD: Final = int64(2)

# Columns of `Memory.state`.
STATE_PLACE: Final = 0
STATE_MASK: Final = 1
FIRST_ON_GROUND: Final = int64(2)
FIRST_IN_AIR: Final = int64(3)

# Columns of `Memory.state_best`.
SOONEST: Final = 0
MOST: Final = 1

# Columns of `Memory.period`.
FLOWN_IN: Final = 0
LEAVES_IN: Final = 1


class Memory(NamedTuple):
    """The notes of one search; arrays that are full are enlarged between two runs.

    `counts` holds how much of each array is in use, `best_s` ``(1,)`` the best delivery so far.

    - By place: `row` of the station, `arc_first` and `arc_count` ``(places, 2)``, `window_first`
      and `window_count`, `is_searched`. `table` finds the place of a row, plus 1; 0 is empty.
    - `tree_of` ``(13,)``: the tree of each destination and at last of the source. Where trees are
      kept for later searches, `tree_of_row` holds the tree of each station row, or -1.
    - By tree and place, ``(trees, places)``: `distance` in metres to the tree's root, and the heap
      of places to settle next (`tree_key`, `tree_heap`, `tree_slot`); by tree its `tree_size`, the
      `radius` up to which distances are final and the `reach` up to which it may grow, metres.
    - With a hierarchy, by rank: `rank_distance` ``(ranks, trees)`` metres, `rank_known`, `climb`.
    - By arc: `arc_place` at the other end, `arc_segment` its row, `arc_length` in metres: for arcs
      that arrive the least length by the weather, see `kernels.weather`. For arcs that leave
      `arc_detours`, see `places`; -1 before it is known. With weather `arc_column` is the
      segment's row among the factors, -1 without.
    - `window_s` ``(windows, 2)``: the free windows of a place, one after another.
    - `state` ``(states, 4)``: its columns are above; `state_bound` ``(states, 3)``: seconds, see
      `bounds`; with windows the last column is the last useful moment there. `state_ahead`
      ``(states, 12)``: by destination the state at the same place that has delivered this one too,
      or -1. `state_best` ``(states, 2)``: the earliest time and the most charge of any label there
      so far. `state_table` finds the state of a place and mask, plus 1.
    - `label` ``(labels, 8)``: the earliest time, the charge level at which the last pad was left
      for that time with its position on the charge curve (seconds), the highest level the pad could
      give with its position, the joules used since, the latest moment to which the drone can delay
      its arrival in the air, and two numbers of 4 bytes: in `next_label` the next label of its
      state's list, and in `most_before_j` the most charge that a label from here to the end of the
      list can have. So all that a walk through the list reads of a label lies in one cache line. A
      list begins with the latest time.
    - `not_before_s` by label: the moment before which the last flight or landing may not begin.
    - `link` ``(labels, 5)``: the label before, its state, how it was made, by which arc or window,
      and whether its list holds it: not, as a new label, or as a label with a `period`.
    - With weather `period` ``(labels, 2)``: the period in which the label's segment was flown, and
      the period in which the drone leaves next. The second is there for labels with a period only.
    - `queue_key`, `queue_label`: a binary heap of labels by the earliest delivery they promise.
    - In a narrow search `layer`: how many labels were taken from the queue, by the least time until
      the last delivery. `layer_size` ``(2,)``: the seconds of a layer, and the most labels of it.
    """

    counts: Longs
    best_s: Floats
    row: Longs
    table: Longs
    arc_first: Longs
    arc_count: Longs
    window_first: Longs
    window_count: Longs
    is_searched: Longs
    tree_of: Longs
    tree_of_row: Longs
    distance: Floats
    rank_distance: Floats
    rank_known: Longs
    climb: Longs
    radius: Floats
    reach: Floats
    tree_key: Floats
    tree_heap: Longs
    tree_slot: Longs
    tree_size: Longs
    arc_place: Longs
    arc_segment: Longs
    arc_length: Floats
    arc_detours: Longs
    arc_column: Longs
    window_s: Floats
    state: Longs
    state_bound: Floats
    state_ahead: Ints
    state_best: Floats
    state_table: Longs
    label: Floats
    next_label: Ints
    most_before_j: Singles
    not_before_s: Floats
    link: Longs
    period: Longs
    queue_key: Floats
    queue_label: Longs
    layer: Longs
    layer_size: Floats
