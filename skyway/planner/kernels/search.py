"""The search itself: take the most promising label, enter what follows, until the best is proven."""

import numpy as np

from skyway.planner.kernels.charging import position_of
from skyway.planner.kernels.compiler import entrance, kernel
from skyway.planner.kernels.labels import (
    FULL_MEMORY,
    enlist,
    note,
    note_goal,
    pop,
    push,
    push_with,
    state_of,
)
from skyway.planner.kernels.memory import (
    ALIVE,
    BEST,
    DETAIL,
    FULL,
    KIND,
    LABELS,
    LAST_POSITION,
    PARENT,
    POSITION,
    QUEUE,
    SESSION,
    START,
    STATE,
    STATE_PLACE,
    TIME,
    Book,
    Closed,
    Memory,
    Skyway,
    Task,
)
from skyway.planner.kernels.moves import expand
from skyway.planner.kernels.places import place_of
from skyway.planner.kernels.sessions import enter_session, enter_sessions

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
    place = place_of(memory, task.start)
    if place < 0:
        return False
    count = task.destinations.size
    at_source = task.start == task.source
    mask = 0 if at_source else 1 << count
    loaded_s = task.loading_s if at_source else 0.0
    position = position_of(task, task.start_j)
    label = note(
        memory, -1, START, -1, loaded_s, position, task.start_j, position, task.start_j, 0.0,
        np.inf, -np.inf,
    )
    if label == FULL_MEMORY:
        return False
    if at_source and count == 0:
        if (
            task.start_j >= task.reserve_j + task.finish_j_at_source - task.rounding_j
            and loaded_s <= task.latest_s
        ):
            note_goal(memory, label, loaded_s)
        return True
    state = state_of(skyway, task, closed, memory, place, mask)
    if state < 0:
        return False
    if enlist(task, memory, label, state, True) < 0:
        return True
    if not enter_sessions(skyway, task, closed, given, known, memory, label, place, mask):
        return False
    if memory.link[label, ALIVE] == 1:
        push(task, memory, label)
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
    """Go on until the best plan is proven, nothing is left, or there are so many labels."""
    while memory.count[QUEUE] > 0:
        key = memory.queue_key[0]
        if key >= memory.best_s[0] or (task.weight > 1.0 and memory.count[BEST] >= 0):
            return PROVEN
        if memory.count[LABELS] >= most_labels:
            return PAUSED
        label = pop(memory)
        is_alive = memory.link[label, ALIVE] == 1
        if memory.link[label, KIND] == SESSION and not task.recharges_fully and task.levels == 0:
            _enter_next_sessions(task, memory, label)
        if is_alive and memory.count[FULL] == 0:
            expand(skyway, task, closed, given, known, memory, label)
        if memory.count[FULL] != 0:
            # Entering the same again is harmless: what is there already dominates it.
            push_with(memory, label, key)
            return OUT_OF_MEMORY
    return PROVEN if memory.count[BEST] >= 0 else EXHAUSTED


@kernel
def _enter_next_sessions(task, memory, label):
    """The session at the next window: after this one, and in place of it."""
    state = memory.link[label, STATE]
    place = memory.state[state, STATE_PLACE]
    window = memory.link[label, DETAIL] + 1
    end = memory.window_first[place] + memory.window_count[place]
    if window >= end:
        return
    if memory.link[label, ALIVE] == 1:
        enter_session(task, memory, label, state, window, end)
    parent = memory.link[label, PARENT]
    waited_s = memory.label[label, TIME] - memory.label[parent, TIME]
    left_s = memory.label[parent, LAST_POSITION] - memory.label[parent, POSITION]
    if waited_s < left_s:
        enter_session(task, memory, parent, state, window, end)
