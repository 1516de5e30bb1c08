"""Labels: written, entered into the lists of their states, and removed again.

A label stands for a function: the most charge at each moment. The search decides later how long
the drone stays at the last pad. Each state keeps its undominated labels in two lists, on the ground
and in the air: a drone on the ground can do all that a drone in the air can, and it can wait.
"""

import numpy as np

from skyway.planner.kernels.charging import Charge
from skyway.planner.kernels.compiler import kernel
from skyway.planner.kernels.dominance import dominates
from skyway.planner.kernels.memory import (
    ALIVE,
    BEST,
    DETAIL,
    FIRST_IN_AIR,
    FIRST_ON_GROUND,
    FULL,
    KIND,
    LABELS,
    LAST_LEVEL,
    LAST_POSITION,
    LATEST,
    LEVEL,
    NEXT,
    NONE,
    NOT_BEFORE,
    PARENT,
    POSITION,
    STATE,
    STATE_MASK,
    TIME,
    USED,
    Floats,
    Memory,
)
from skyway.planner.kernels.queue import push
from skyway.planner.kernels.records import Task
from skyway.planner.kernels.states import still_s

# Why there is no label.
DOMINATED = -1
FULL_MEMORY = -2
TOO_LATE = -3

# The share of a wait for a window by which the queue orders labels that wait for it.
_SHARE_OF_WAIT = 1e-9


@kernel
def charge_of(memory: Memory, label: int) -> Charge:
    """The charge with which the drone leaves the last pad, and the most it may leave with."""
    row = memory.label[label]
    return Charge(row[POSITION], row[LEVEL], row[LAST_POSITION], row[LAST_LEVEL])


@kernel
def note(
    memory: Memory,
    parent: int,
    kind: int,
    detail: int,
    time_s: float,
    charge: Charge,
    used_j: float,
    latest_s: float,
    not_before_s: float,
) -> int:
    """Write a label that is in no list yet; `FULL_MEMORY` if there is no room."""
    label = memory.counts[LABELS]
    if label >= memory.label.shape[0]:
        memory.counts[FULL] = 1
        return FULL_MEMORY
    row = memory.label[label]
    row[TIME] = time_s
    row[POSITION] = charge.position
    row[LEVEL] = charge.level
    row[LAST_POSITION] = charge.last_position
    row[LAST_LEVEL] = charge.last_level
    row[USED] = used_j
    row[LATEST] = latest_s
    row[NOT_BEFORE] = not_before_s
    link = memory.link[label]
    link[PARENT] = parent
    link[KIND] = kind
    link[DETAIL] = detail
    link[STATE] = NONE
    link[NEXT] = NONE
    link[ALIVE] = 0
    memory.counts[LABELS] = label + 1
    return label


@kernel
def enlist(task: Task, memory: Memory, label: int, state: int, column: int) -> int:
    """Enter the newest label into a list of its state, or remove it if it is dominated.

    `column` is `FIRST_ON_GROUND` or `FIRST_IN_AIR`. Returns the label, or `DOMINATED`, or
    `TOO_LATE` when no plan in time can follow.
    """
    row = memory.label[label]
    key = row[TIME] + still_s(task, memory, state, row[LEVEL] - row[USED])
    if task.may_pass:
        key = max(key, task.floor_s[memory.state[state, STATE_MASK]])
        if row[TIME] > memory.state_bound[state, 2]:
            key = np.inf
    if not key < memory.best_s[0] or key > task.latest_s:
        memory.counts[LABELS] = label
        return TOO_LATE
    if task.prunes:
        on_ground = column == FIRST_ON_GROUND
        if _is_dominated(task, memory, state, FIRST_ON_GROUND, row) or (
            not on_ground and _is_dominated(task, memory, state, FIRST_IN_AIR, row)
        ):
            memory.counts[LABELS] = label
            return DOMINATED
        if on_ground:
            _weed(task, memory, state, FIRST_ON_GROUND, row)
        _weed(task, memory, state, FIRST_IN_AIR, row)
    link = memory.link[label]
    link[STATE] = state
    link[ALIVE] = 1
    link[NEXT] = memory.state[state, column]
    memory.state[state, column] = label
    return label


@kernel
def delist(memory: Memory, label: int) -> None:
    """Remove a label from its list again, because there was no room for the labels after it."""
    state = memory.link[label, STATE]
    memory.link[label, ALIVE] = 0
    for column in (FIRST_ON_GROUND, FIRST_IN_AIR):
        before = NONE
        other = memory.state[state, column]
        while other >= 0:
            if other == label:
                _unlink(memory, state, column, before, other)
                return
            before = other
            other = memory.link[other, NEXT]


@kernel
def enqueue(task: Task, memory: Memory, label: int) -> None:
    """Put a label that is still in its list into the queue."""
    if memory.link[label, ALIVE] == 0:
        return
    row = memory.label[label]
    state = memory.link[label, STATE]
    left_s = still_s(task, memory, state, row[LEVEL] - row[USED])
    key = row[TIME] + task.weight * left_s
    if task.may_pass:
        floor_s = task.floor_s[memory.state[state, STATE_MASK]]
        # Before labels that wait for the same window, those come first that would be earliest.
        if key < floor_s:
            key = floor_s - (floor_s - key) * _SHARE_OF_WAIT
    push(memory, label, key)


@kernel
def note_goal(memory: Memory, label: int, delivered_s: float) -> None:
    """Keep a label that has delivered everything, if it is the earliest so far."""
    if delivered_s < memory.best_s[0]:
        memory.best_s[0] = delivered_s
        memory.counts[BEST] = label


@kernel
def _is_dominated(task: Task, memory: Memory, state: int, column: int, row: Floats) -> bool:
    """Whether a label of this list dominates the row."""
    label = memory.state[state, column]
    while label >= 0:
        if dominates(task, memory.label[label], row):
            return True
        label = memory.link[label, NEXT]
    return False


@kernel
def _weed(task: Task, memory: Memory, state: int, column: int, row: Floats) -> None:
    """Remove the labels that this row dominates from a list."""
    before = NONE
    label = memory.state[state, column]
    while label >= 0:
        following = memory.link[label, NEXT]
        if dominates(task, row, memory.label[label]):
            memory.link[label, ALIVE] = 0
            _unlink(memory, state, column, before, label)
        else:
            before = label
        label = following


@kernel
def _unlink(memory: Memory, state: int, column: int, before: int, label: int) -> None:
    """Unlink this label from the list; it follows `before`, or is the first."""
    following = memory.link[label, NEXT]
    if before < 0:
        memory.state[state, column] = following
    else:
        memory.link[before, NEXT] = following
