"""The memory of a search as arrays: their first sizes, and how they grow."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from skyway.planner.kernels.handles import handle_of
from skyway.planner.kernels.memory import (
    ARCS,
    BEST,
    FULL,
    LABELS,
    PLACES,
    QUEUE,
    STATES,
    WINDOWS,
    Floats,
    Memory,
)
from skyway.planner.kernels.places import refill_table
from skyway.planner.kernels.states import refill_state_table

#: The destinations of a search and its source.
MOST_TREES: Final = 13

#: By so much places, arcs, windows, states and labels grow. Windows and labels are most of a long
#: search's memory: each copy of them makes new pages, which the system clears. Our own choice.
_TIMES_LARGER: Final = np.array([2, 2, 4, 2, 4])

#: The arrays of a hierarchy, of kept trees and of a narrow search.
_NEVER_GROWN: Final = frozenset(
    ("rank_distance", "rank_known", "climb", "tree_of_row", "layer", "layer_size")
)

#: Bytes that the processor loads together.
_LINE: Final = 64

#: Labels that may be in the queue once more, because they were put back.
_PUT_BACK = 8


@dataclass(frozen=True, slots=True)
class Room:
    """The sizes of the arrays before the first enlargement.

    A search for eight packages within 45 km meets 2,000 to 4,000 places. Where most pads are taken,
    eight packages across 10,000 stations need about 16,000 windows. The pages of memory that a
    search does not use cost nothing, but each enlargement copies all rows.
    """

    places: int = 1 << 13
    arcs: int = 1 << 16
    windows: int = 1 << 15
    states: int = 1 << 11
    labels: int = 1 << 12


#: Sizes that most requests never fill.
AMPLE: Final = Room()


def new_memory(
    trees: int, ranks: int = 0, *, room: Room = AMPLE, has_weather: bool = False, layers: int = 0
) -> Memory:
    """The empty memory of a search with so many trees, and a hierarchy of so many ranks or none.

    Places and states have to be powers of two. A narrow search has layers.
    """
    memory = _sized(trees, ranks, room, has_weather=has_weather, layers=layers)
    memory.counts[BEST] = -1
    memory.best_s[0] = np.inf
    memory.radius[:] = -1.0
    return memory


def enlarged(memory: Memory, *, trees: int | None = None) -> Memory:
    """The same memory with more room in each array that is half full; it shares the other arrays.

    `trees` is the new number of trees; None keeps their number and enlarges another array.
    """
    count = memory.counts
    before = memory.radius.size
    room = _larger_room(memory, must_grow=trees is None)
    has_weather = len(memory.period) > 0
    larger = _sized(before if trees is None else trees, 0, room, has_weather=has_weather)
    used = {
        "row": PLACES, "arc_first": PLACES, "arc_count": PLACES, "window_first": PLACES,
        "window_count": PLACES, "is_searched": PLACES,
        "arc_place": ARCS, "arc_segment": ARCS, "arc_length": ARCS, "arc_column": ARCS,
        "arc_detours": ARCS,
        "window_s": WINDOWS,
        "state": STATES, "state_bound": STATES, "state_ahead": STATES, "state_best": STATES,
        "label": LABELS, "not_before_s": LABELS, "link": LABELS, "period": LABELS,
        "queue_key": QUEUE, "queue_label": QUEUE,
    }  # fmt: skip
    kept = {
        name: array
        for name, array in memory._asdict().items()
        if name in _NEVER_GROWN or array.shape == getattr(larger, name).shape
    }
    larger = larger._replace(**kept)
    for name in used.keys() - kept.keys():
        row = count[used[name]]
        getattr(larger, name)[:row] = getattr(memory, name)[:row]
    for name in {"radius", "reach", "tree_size"} - kept.keys():
        getattr(larger, name)[:before] = getattr(memory, name)
    for name in {"distance", "tree_key", "tree_heap", "tree_slot"} - kept.keys():
        getattr(larger, name)[:before, : count[PLACES]] = getattr(memory, name)[:, : count[PLACES]]
    larger.counts[FULL] = 0
    notes = handle_of(larger)
    if "table" not in kept:
        refill_table(notes)
    if "state_table" not in kept:
        refill_state_table(notes)
    return larger


def _larger_room(memory: Memory, *, must_grow: bool) -> Room:
    sized = (memory.row, memory.arc_place, memory.window_s, memory.state, memory.label)
    sizes = np.array([len(each) for each in sized])
    used = memory.counts[[PLACES, ARCS, WINDOWS, STATES, LABELS]]
    grows = 2 * used >= sizes
    if must_grow and not grows.any():
        # One station needed more arcs or windows than were left.
        grows[:] = True
    return Room(*np.where(grows, _TIMES_LARGER * sizes, sizes).tolist())


def _sized(trees: int, ranks: int, room: Room, *, has_weather: bool, layers: int = 0) -> Memory:
    """Arrays of these sizes; only counts and tables are filled, with zeros."""
    places, arcs, states, labels = room.places, room.arcs, room.states, room.labels
    label = _in_lines(labels, 8)
    return Memory(
        counts=np.zeros(11, np.int64),
        best_s=np.empty(1),
        row=np.empty(places, np.int64),
        table=np.zeros(2 * places, np.int64),
        arc_first=np.empty((places, 2), np.int64),
        arc_count=np.empty((places, 2), np.int64),
        window_first=np.empty(places, np.int64),
        window_count=np.empty(places, np.int64),
        is_searched=np.empty(places, np.int64),
        tree_of=np.arange(MOST_TREES, dtype=np.int64),
        tree_of_row=np.empty(0, np.int64),
        distance=np.empty((trees, places)),
        rank_distance=np.empty((ranks, trees)),
        rank_known=np.zeros(ranks, np.int64),
        climb=np.empty(ranks, np.int64),
        radius=np.empty(trees),
        reach=np.empty(trees),
        tree_key=np.empty((trees, places)),
        tree_heap=np.empty((trees, places), np.int64),
        tree_slot=np.empty((trees, places), np.int64),
        tree_size=np.zeros(trees, np.int64),
        arc_place=np.empty(arcs, np.int64),
        arc_segment=np.empty(arcs, np.int64),
        arc_length=np.empty(arcs),
        arc_detours=np.empty(arcs, np.int64),
        arc_column=np.empty(arcs if has_weather else 0, np.int64),
        window_s=np.empty((room.windows, 2)),
        state=np.empty((states, 4), np.int64),
        state_bound=np.empty((states, 3)),
        state_ahead=np.empty((states, MOST_TREES - 1), np.int32),
        state_best=np.empty((states, 2)),
        state_table=np.zeros(2 * states, np.int64),
        label=label,
        next_label=label.view(np.int32),
        most_before_j=label.view(np.float32),
        not_before_s=np.empty(labels),
        link=np.empty((labels, 5), np.int64),
        period=np.empty((labels if has_weather else 0, 2), np.int64),
        queue_key=np.empty(labels + _PUT_BACK),
        queue_label=np.empty(labels + _PUT_BACK, np.int64),
        layer=np.zeros(layers, np.int64),
        layer_size=np.zeros(2),
    )


def _in_lines(rows: int, columns: int) -> Floats:
    """An empty array whose first row begins with a cache line: no row of 64 bytes lies in two."""
    size = rows * columns
    values = np.empty(size + _LINE // 8)
    skipped = -values.ctypes.data % _LINE // 8
    return values[skipped : skipped + size].reshape(rows, columns)
