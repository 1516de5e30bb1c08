"""Many trips in one compiled call, which plans each trip by the same search as a single problem.

The memory of the search is kept from trip to trip: stations, free windows, and the trees of
destinations. Only states, labels and the queue belong to one trip.
"""

import numpy as np

from skyway.planner.kernels.closures import is_closed_for_good
from skyway.planner.kernels.compiler import array_kernel, entrance, kernel
from skyway.planner.kernels.memory import (
    BEST,
    FULL,
    LABELS,
    NONE,
    PLACES,
    QUEUE,
    STALE,
    STATE_MASK,
    STATE_PLACE,
    STATES,
    TREES,
    WINDOWS,
    Memory,
    int64,
)
from skyway.planner.kernels.places import place_of
from skyway.planner.kernels.records import (
    Book,
    Closed,
    Found,
    Search,
    Skyway,
    Terms,
    TripRows,
)
from skyway.planner.kernels.search import EXHAUSTED, OUT_OF_MEMORY, begin_search, run_search
from skyway.planner.kernels.search import PROVEN as SEARCH_PROVEN
from skyway.planner.kernels.states import slot_of_state
from skyway.planner.kernels.trees import REACH, grow, plant
from skyway.planner.kernels.trip_acts import ACTS, DONE, SESSIONS, fly_acts, keep_acts
from skyway.planner.kernels.trip_tasks import Drops, drops_of, task_of_trip
from skyway.units import LOAD_TOLERANCE_KG

# How a call ended.
ALL_DONE = 0
MEMORY_FULL = 1
TREES_FULL = 2
ROWS_FULL = 3
LABELS_MADE = 4

# The outcome of a trip, see `skyway.planner.planned_trips.TripOutcome`.
PROVEN = 0
FEASIBLE = 1
UNKNOWN = 2
NO_PLAN = 3
OVERWEIGHT = 4
UNREACHABLE = 5


@entrance
def plan_trips(
    skyway: Skyway,
    closed: Closed,
    given: Book,
    known: Book,
    memory: Memory,
    terms: Terms,
    trips: TripRows,
    found: Found,
    labels_per_trip: int,
    labels_per_call: int,
) -> int:
    """Plan the remaining trips; returns how the call ended: `ALL_DONE`, or why trips remain."""
    made = int64(0)
    while found.counts[DONE] < found.outcome.size:
        if made >= labels_per_call:
            return LABELS_MADE
        trip = found.counts[DONE]
        drops = drops_of(terms, trips, trip)
        found.end_row[trip] = NONE
        outcome = _hopeless(closed, terms, trips, trip, drops)
        if outcome < 0:
            _forget_search(memory)
            ended = _ready_trees(skyway, closed, memory, trips, trip, drops)
            if ended != ALL_DONE:
                return ended
            apart_m = _apart_m(memory, trips, trip, drops)
            is_closed = closed.keys.size > 0
            task = task_of_trip(terms, trips, trip, drops, apart_m, is_closed)
            if memory.counts[FULL] != 0:
                memory.counts[FULL] = 0
                return MEMORY_FULL
            search = Search(skyway, task, closed, given, known, memory)
            outcome = _solve(search, labels_per_trip)
            if outcome < 0:
                return MEMORY_FULL
            made += memory.counts[LABELS]
            found.labels[trip] = memory.counts[LABELS]
            if outcome <= FEASIBLE:
                is_kept = keep_acts(search, found) >= 0
                if not is_kept or not fly_acts(search, terms, trips, found, trip, drops):
                    found.counts[ACTS] = found.act_offsets[trip]
                    return ROWS_FULL
        found.outcome[trip] = outcome
        found.act_offsets[trip + 1] = found.counts[ACTS]
        found.session_offsets[trip + 1] = found.counts[SESSIONS]
        found.counts[DONE] = trip + 1
    return ALL_DONE


@array_kernel
def _solve(search: Search, most_labels: int) -> int:
    """Search for the best plan; the outcome, or -1 when the memory is full."""
    memory, count = search.memory, int64(search.task.destinations.size)
    if count > 0 and not np.isfinite(search.task.flight_after[0]).any():
        return UNREACHABLE
    if not begin_search(search):
        return NONE
    ended = run_search(search, most_labels)
    if ended == OUT_OF_MEMORY:
        return NONE
    if ended == SEARCH_PROVEN:
        return PROVEN
    if ended == EXHAUSTED:
        for number in range(count):
            if _distance_m(memory, number, search.task.source) == np.inf:
                return UNREACHABLE
        return NO_PLAN
    return FEASIBLE if memory.counts[BEST] >= 0 else UNKNOWN


@kernel
def _hopeless(closed: Closed, terms: Terms, trips: TripRows, trip: int, drops: Drops) -> int:
    """The outcome of a trip that no search can plan; -1 for all others."""
    if drops.load_kg > terms.payload_kg[trips.model[trip]] + LOAD_TOLERANCE_KG:
        return OVERWEIGHT
    if closed.keys.size > 0:
        for number in range(drops.row.size):
            if is_closed_for_good(closed, closed.first_station_key + drops.row[number]):
                return UNREACHABLE
        source = int64(trips.source[trip])
        if trips.start[trip] != source and is_closed_for_good(
            closed, closed.first_station_key + source
        ):
            return UNREACHABLE
    return NONE


@kernel
def _forget_search(memory: Memory) -> None:
    """Remove the states and labels of the earlier trip, and windows if most are out of date."""
    # The last state goes first, so that the table still finds each of the other states.
    for state in range(memory.counts[STATES] - 1, -1, -1):
        place, mask = memory.state[state, STATE_PLACE], memory.state[state, STATE_MASK]
        memory.state_table[slot_of_state(memory, place, mask)] = 0
    memory.counts[STATES] = 0
    memory.counts[LABELS] = 0
    memory.counts[QUEUE] = 0
    memory.counts[FULL] = 0
    memory.counts[BEST] = NONE
    memory.best_s[0] = np.inf
    if 2 * memory.counts[STALE] > memory.window_s.shape[0]:
        memory.window_first[: memory.counts[PLACES]] = NONE
        memory.counts[WINDOWS] = 0
        memory.counts[STALE] = 0


@kernel
def _ready_trees(
    skyway: Skyway, closed: Closed, memory: Memory, trips: TripRows, trip: int, drops: Drops
) -> int:
    """Grow the trees of this trip as far as the trip reaches; returns how it ended."""
    count = int64(drops.row.size)
    start, source = int64(trips.start[trip]), int64(trips.source[trip])
    approaches = start != source or drops.may_pass
    for number in range(count + 1):
        if number == count and not approaches:
            break
        root = source if number == count else int64(drops.row[number])
        if memory.tree_of_row[root] < 0:
            place = place_of(memory, root)
            if place < 0:
                return MEMORY_FULL
            if memory.counts[TREES] >= memory.radius.size:
                return TREES_FULL
            tree = memory.counts[TREES]
            memory.counts[TREES] = tree + 1
            memory.tree_of_row[root] = tree
            memory.tree_size[tree] = 0
            memory.reach[tree] = 0.0
            memory.distance[tree, : memory.counts[PLACES]] = np.inf
            memory.tree_slot[tree, : memory.counts[PLACES]] = NONE
            plant(memory, tree, place)
        memory.tree_of[number] = memory.tree_of_row[root]
    for number in range(count + 1):
        if number == count and not approaches:
            break
        tree = memory.tree_of[number]
        for other in range(count + 1):
            target = source if other == count else int64(drops.row[other])
            if number == count:
                target = start
            until = place_of(memory, target)
            if until < 0:
                return MEMORY_FULL
            if memory.distance[tree, until] > memory.radius[tree] and not grow(
                skyway, closed, memory, tree, until, np.inf
            ):
                return MEMORY_FULL
            length_m = memory.distance[tree, until]
            memory.reach[tree] = max(memory.reach[tree], REACH * length_m)
    return ALL_DONE


@kernel
def _distance_m(memory: Memory, number: int, row: int) -> float:
    """Metres from a station to a destination, by the trip's trees."""
    return memory.distance[memory.tree_of[number], place_of(memory, int64(row))]


@array_kernel
def _apart_m(memory: Memory, trips: TripRows, trip: int, drops: Drops) -> np.ndarray:
    """Metres from each destination, and last from the source, to each destination."""
    count = int64(drops.row.size)
    apart_m = np.empty((count + 1, count), np.float64)
    for number in range(count + 1):
        row = int64(trips.source[trip]) if number == count else int64(drops.row[number])
        for other in range(count):
            apart_m[number, other] = _distance_m(memory, other, row)
    return apart_m
