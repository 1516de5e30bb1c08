"""What the kernels work on: the skyway, the task, what is closed and taken, and their own notes.

A *place* is a station that the search has met, numbered in the order of meeting: all notes are
kept by place, so what a search costs follows the request's reach and not the network's size.
A *mask* is a set of delivered destinations, bit by bit; the mask ``2**k`` stands for the approach,
with no package on board yet.
"""

from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int32]
Longs = npt.NDArray[np.int64]

INWARD: Final = 0
OUTWARD: Final = 1

# Rows of `Memory.count`: how much of each array is in use, and which one ran full.
PLACES: Final = 0
ARCS: Final = 1
WINDOWS: Final = 2
STATES: Final = 3
LABELS: Final = 4
QUEUE: Final = 5
FULL: Final = 6
SEARCHED: Final = 7
BEST: Final = 8

# How a label came to be.
START: Final = 0
FLOWN: Final = 1
LANDED: Final = 2
SESSION: Final = 3
HANDED_OVER: Final = 4

# Columns of `Memory.label`.
TIME: Final = 0
POSITION: Final = 1
LEVEL: Final = 2
LAST_POSITION: Final = 3
LAST_LEVEL: Final = 4
USED: Final = 5
LATEST: Final = 6
NOT_BEFORE: Final = 7

# Columns of `Memory.link`.
PARENT: Final = 0
STATE: Final = 1
NEXT: Final = 2
KIND: Final = 3
DETAIL: Final = 4
ALIVE: Final = 5

# Columns of `Memory.state`.
STATE_PLACE: Final = 0
STATE_MASK: Final = 1
FIRST_ON_GROUND: Final = 2
FIRST_IN_AIR: Final = 3


class Skyway(NamedTuple):
    """The network's rows: who can be flown to, and from where, and how many pads there are.

    `offsets` are ``(n_stations + 1,)`` int64, the rest ``(n_segments,)``; lengths in metres. What
    follows `pads` is the hierarchy (see `skyway.planner.hierarchy`), empty if there is none.
    """

    in_offsets: Longs
    in_station: Ints
    in_segment: Ints
    in_length: Floats
    out_offsets: Longs
    out_station: Ints
    out_segment: Ints
    out_length: Floats
    pads: Ints
    rank: Longs
    above_offsets: Longs
    above: Longs
    up_length: Floats
    down_length: Floats


class Closed(NamedTuple):
    """Closed times by segment row, and by station row counted on from the last segment.

    `keys` are sorted; the closures of ``keys[i]`` are those from ``offsets[i]`` to
    ``offsets[i + 1]``, seconds, in any order, and may overlap.
    """

    keys: Longs
    offsets: Longs
    start_s: Floats
    end_s: Floats
    first_station_key: int


class Book(NamedTuple):
    """Reservations of pads, sorted by station row, pad and start; whole milliseconds.

    `zero_ms` is the moment of the plan's start on the book's own scale.
    """

    station: Ints
    pad: Ints
    start_ms: Longs
    end_ms: Longs
    zero_ms: int


class Task(NamedTuple):
    """The drone and its packages; energies in joules, moments in seconds.

    By mask: `s_per_m` and `j_per_m` with the load; for the bounds `flight_s_per_m` and
    `need_per_m`. A need is what charging is counted by: joules where sessions go on to the top,
    else seconds of flying and of charging the flown joules. ``flight_after[mask, j]`` and
    ``need_after[mask, j]`` bound what follows once destination j is reached; inf where j may not
    be next. `s_per_j` is the least time that charging takes.
    """

    destinations: Ints
    source: int
    start: int
    s_per_m: Floats
    j_per_m: Floats
    flight_s_per_m: Floats
    need_per_m: Floats
    flight_after: Floats
    need_after: Floats
    approach_flight_after: float
    approach_need_after: float
    finish_j: Floats
    finish_j_at_source: float
    curve_s: Floats
    curve_j: Floats
    start_j: float
    reserve_j: float
    rounding_j: float
    s_per_j: float
    stop_s: float
    stop_j: float
    loading_s: float
    dropoff_s: float
    latest_s: float
    recharges_fully: bool
    prunes: bool
    levels: int
    weight: float


class Memory(NamedTuple):
    """What one search has noted; arrays that run full are made larger between two runs.

    `label` holds for each label the earliest time, the charge level at which the last pad was left
    for that time with its position on the charge curve (seconds), the most that pad could still
    give with its position, the joules used since, the latest moment to which the arrival can be
    put off in the air, and the moment before which the last flight or landing may not begin.
    """

    count: Longs
    best_s: Floats
    row: Longs
    table: Longs
    arc_first: Longs
    arc_count: Longs
    window_first: Longs
    window_count: Longs
    is_searched: Longs
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
    window_s: Floats
    state: Longs
    state_bound: Floats
    state_table: Longs
    label: Floats
    link: Longs
    queue_key: Floats
    queue_label: Longs
