"""The search: expand the most promising label, until the best plan is proven."""

import numpy as np

from skyway.planner.kernels.charging import Charge, position_of
from skyway.planner.kernels.compiler import entrance, fetch_soon, kernel
from skyway.planner.kernels.flights import expand
from skyway.planner.kernels.labels import (
    FULL_MEMORY,
    enlist,
    enqueue,
    enqueue_later,
    is_behind,
    note,
    note_goal,
)
from skyway.planner.kernels.landings import stand
from skyway.planner.kernels.memory import (
    ALIVE,
    BEST,
    FIRST_ON_GROUND,
    FULL,
    KIND,
    LABELS,
    LEAVES_IN,
    LEVEL,
    NEW,
    NONE,
    QUEUE,
    SESSION,
    START,
    STATE,
    USED,
    WITH_PERIOD,
    Memory,
    int64,
)
from skyway.planner.kernels.places import place_of
from skyway.planner.kernels.queue import pop, push
from skyway.planner.kernels.records import Book, Closed, Search, Skyway, Task
from skyway.planner.kernels.sessions import enter_next_sessions
from skyway.planner.kernels.states import state_of, still_s
from skyway.planner.kernels.weather import first_period, has_weather

# How a run ended.
PROVEN = 0
EXHAUSTED = 1
PAUSED = 2
OUT_OF_MEMORY = 3


@entrance
def begin(
    skyway: Skyway, task: Task, closed: Closed, given: Book, known: Book, memory: Memory
) -> bool:
    """Enter the drone at time 0, packages on board if it stands at the source; False when full."""
    return begin_search(Search(skyway, task, closed, given, known, memory))


@kernel
def begin_search(search: Search) -> bool:
    """`begin`, for other kernels."""
    task, memory = search.task, search.memory
    place = place_of(memory, task.start)
    if place < 0:
        return False
    count = int64(task.destinations.size)
    at_source = task.start == task.source and not task.may_pass
    mask = int64(0) if at_source else int64(1) << count
    loaded_s = task.begin_s + (task.loading_s if at_source else 0.0)
    position = position_of(task, int64(0), task.start_j)
    charge = Charge(position, task.start_j, position, task.start_j)
    label = note(memory, NONE, START, NONE, loaded_s, charge, 0.0, np.inf, -np.inf)
    if label == FULL_MEMORY:
        return False
    if at_source and count == 0:
        need_j = task.reserve_j + task.finish_j_at_source
        if task.start_j >= need_j - task.rounding_j and loaded_s <= task.latest_s:
            note_goal(memory, label, loaded_s)
        return True
    state = state_of(search, place, mask)
    if state < 0:
        return False
    if enlist(task, memory, label, state, FIRST_ON_GROUND) >= 0:
        enqueue(task, memory, label)
    return True


@entrance
def run(
    skyway: Skyway,
    task: Task,
    closed: Closed,
    given: Book,
    known: Book,
    memory: Memory,
    most_labels: int,
) -> int:
    """Search until the best plan is proven, no label is left, or there are this many labels."""
    return run_search(Search(skyway, task, closed, given, known, memory), most_labels)


@kernel
def run_search(search: Search, most_labels: int) -> int:
    """`run`, for other kernels."""
    task, memory = search.task, search.memory
    in_weather = has_weather(search.skyway)
    while memory.counts[QUEUE] > 0:
        key = memory.queue_key[0]
        # Raised bounds prove nothing: such a search ends with its first plan.
        has_plan = memory.counts[BEST] >= 0
        if has_plan if task.weight > 1.0 else key >= memory.best_s[0]:
            return PROVEN
        if memory.counts[LABELS] >= most_labels:
            return PAUSED
        label = pop(memory)
        _fetch_next(memory)
        if memory.layer.size > 0 and _is_crowded(task, memory, label):
            continue
        is_alive = memory.link[label, ALIVE] != 0
        if is_alive and task.compares_masks and is_behind(task, memory, label):
            memory.link[label, ALIVE] = 0
            is_alive = False
        period = int64(0)
        if memory.link[label, ALIVE] == WITH_PERIOD:
            period = memory.period[label, LEAVES_IN]
        elif memory.link[label, KIND] != SESSION:
            if is_alive:
                stand(search, label)
                # Where a pad is free, the label on that pad replaces this one.
                is_alive = memory.link[label, ALIVE] != 0
        elif not task.recharges_fully and task.levels == 0:
            enter_next_sessions(task, memory, label)
        if is_alive and in_weather and memory.link[label, ALIVE] == NEW:
            period = first_period(search, label)
        if is_alive and memory.counts[FULL] == 0:
            expand(search, label, period)
        if memory.counts[FULL] != 0:
            # Entering the same label again is harmless: the existing label dominates it.
            push(memory, label, key)
            return OUT_OF_MEMORY
        if is_alive and in_weather:
            _enqueue_for_next_period(search, label, period)
    return PROVEN if memory.counts[BEST] >= 0 else EXHAUSTED


@kernel
def _fetch_next(memory: Memory) -> None:
    """Fetch the label that the search probably takes next: labels lie all over a large memory."""
    if memory.counts[QUEUE] > 0:
        fetch_soon(memory.link, memory.queue_label[0])
        fetch_soon(memory.label, memory.queue_label[0])


@kernel
def _is_crowded(task: Task, memory: Memory, label: int) -> bool:
    """Whether a narrow search has taken enough labels that need about as long as this one."""
    row = memory.label[label]
    left_s = still_s(task, memory, memory.link[label, STATE], row[LEVEL] - row[USED])
    layer = min(int64(left_s / memory.layer_size[0]), memory.layer.size - 1)
    if memory.layer[layer] >= memory.layer_size[1]:
        return True
    memory.layer[layer] += 1
    return False


@kernel
def _enqueue_for_next_period(search: Search, label: int, period: int) -> None:
    """Put a label into the queue again, for drones that leave in the period after this one."""
    edges_s, memory = search.skyway.edges_s, search.memory
    if period >= edges_s.size:
        return
    if enqueue_later(search.task, memory, label, edges_s[period]):
        memory.link[label, ALIVE] = WITH_PERIOD
        memory.period[label, LEAVES_IN] = period + 1
