"""Labels: written, entered into the lists of their states, and removed again.

A label stands for a function: the most charge at each moment. The search decides later how long
the drone stays at the last pad. Each state keeps its undominated labels in two lists, on the ground
and in the air: a drone on the ground can do all that a drone in the air can, and it can wait.
"""

import numpy as np

from skyway.planner.kernels.charging import Charge, after_staying
from skyway.planner.kernels.closures import slack_s
from skyway.planner.kernels.compiler import fetch_soon, kernel
from skyway.planner.kernels.dominance import SAME_S, dominates, rank_s
from skyway.planner.kernels.memory import (
    ALIVE,
    BEST,
    DETAIL,
    FIRST_IN_AIR,
    FIRST_ON_GROUND,
    FLOWN,
    FULL,
    KIND,
    LABELS,
    LAST_LEVEL,
    LAST_POSITION,
    LATEST,
    LEVEL,
    MOST,
    MOST_BEFORE,
    NEXT,
    NONE,
    PARENT,
    POSITION,
    SOONEST,
    STATE,
    STATE_MASK,
    TIME,
    USED,
    Floats,
    Memory,
    int64,
)
from skyway.planner.kernels.queue import push
from skyway.planner.kernels.records import Task
from skyway.planner.kernels.states import still_s

# Why there is no label.
DOMINATED = -1
FULL_MEMORY = -2
TOO_LATE = -3

# Returned instead of a place in a list: a label of the list dominates.
_BEATEN = -2

# More than a float of 4 bytes is less than its number, as a share.
_ROUNDS_UP = 1e-7

# The share of a wait for a window by which the queue orders labels that wait for it.
_SHARE_OF_WAIT = 1e-9


@kernel
def charge_of(memory: Memory, label: int) -> Charge:
    """The charge with which the drone leaves the last pad, and the most it may leave with."""
    row = memory.label[label]
    return Charge(row[POSITION], row[LEVEL], row[LAST_POSITION], row[LAST_LEVEL])


@kernel
def ready_s(memory: Memory, label: int, charge: Charge) -> float:
    """When a drone is here that leaves the last pad with this charge."""
    row = memory.label[label]
    # The difference comes first: without a longer stay it is exactly 0.
    return row[TIME] + (charge.position - row[POSITION])


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
    memory.next_label[label, NEXT] = NONE
    memory.not_before_s[label] = not_before_s
    link = memory.link[label]
    link[PARENT] = parent
    link[KIND] = kind
    link[DETAIL] = detail
    link[STATE] = NONE
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
    before = NONE
    if task.prunes:
        on_ground = column == FIRST_ON_GROUND
        before = _compare(task, memory, state, FIRST_ON_GROUND, row, True, on_ground)
        if before != _BEATEN:
            in_air = _compare(task, memory, state, FIRST_IN_AIR, row, not on_ground, True)
            if in_air == _BEATEN or not on_ground:
                before = in_air
        if before == _BEATEN:
            memory.counts[LABELS] = label
            return DOMINATED
    memory.link[label, STATE] = state
    memory.link[label, ALIVE] = 1
    _insert(memory, label, state, column, before)
    best = memory.state_best[state]
    best[SOONEST] = min(best[SOONEST], rank_s(task, row))
    best[MOST] = max(best[MOST], row[LAST_LEVEL] - row[USED])
    return label


@kernel
def enqueue(task: Task, memory: Memory, label: int) -> None:
    """Put a label that is still in its list into the queue."""
    if memory.link[label, ALIVE] == 0:
        return
    row = memory.label[label]
    state = memory.link[label, STATE]
    left_s = still_s(task, memory, state, row[LEVEL] - row[USED])
    push(memory, label, _in_order(task, memory, state, row[TIME] + task.weight * left_s))


@kernel
def enqueue_later(task: Task, memory: Memory, label: int, leave_s: float) -> bool:
    """Put a label into the queue for drones that leave at this moment or later.

    False when no better plan can follow. Until it leaves, the drone may stay on its last pad.
    """
    row = memory.label[label]
    state = memory.link[label, STATE]
    leave_s = max(leave_s, row[TIME])
    if leave_s > row[LATEST] + slack_s(leave_s):
        return False
    stayed = after_staying(task, charge_of(memory, label), leave_s - row[TIME])
    left_s = still_s(task, memory, state, stayed.level - row[USED])
    key = leave_s + left_s
    if not key < memory.best_s[0] or key > task.latest_s:
        return False
    if task.may_pass and leave_s > memory.state_bound[state, 2]:
        return False
    push(memory, label, _in_order(task, memory, state, leave_s + task.weight * left_s))
    return True


@kernel
def _in_order(task: Task, memory: Memory, state: int, key: float) -> float:
    """The key of the queue for labels of this state that promise so early a delivery."""
    if task.may_pass:
        floor_s = task.floor_s[memory.state[state, STATE_MASK]]
        # Before labels that wait for the same window, those come first that would be earliest.
        if key < floor_s:
            return floor_s - (floor_s - key) * _SHARE_OF_WAIT
    return key


@kernel
def note_goal(memory: Memory, label: int, delivered_s: float) -> None:
    """Keep a label that has delivered everything, if it is the earliest so far."""
    if delivered_s < memory.best_s[0]:
        memory.best_s[0] = delivered_s
        memory.counts[BEST] = label


@kernel
def is_behind(task: Task, memory: Memory, label: int) -> bool:
    """Whether a label at the same place dominates this one, and has delivered one package more.

    Only with `compares_masks`: then a drone with less on board can follow any plan of another drone
    and leave out the packages that it has delivered.
    """
    state, row = memory.link[label, STATE], memory.label[label]
    is_flown = memory.link[label, KIND] == FLOWN
    on_ground = not is_flown or (task.stop_s == 0.0 and task.stop_j == 0.0)
    count = int64(task.destinations.size)
    if memory.state[state, STATE_MASK] == int64(1) << count:
        return False
    missing_j = _missing_j(task, memory, state, row)
    # The processor loads all of them together, and does not wait for one after another.
    for number in range(count):
        if memory.state_ahead[state, number] >= 0:
            fetch_soon(memory.state_best, int64(memory.state_ahead[state, number]))
            fetch_soon(memory.state, int64(memory.state_ahead[state, number]))
    latest_s = rank_s(task, row) + SAME_S
    needed_j = row[LAST_LEVEL] - row[USED] - task.rounding_j
    for number in range(count):
        other = int64(memory.state_ahead[state, number])
        if other < 0:
            continue
        best = memory.state_best[other]
        if best[SOONEST] > latest_s or best[MOST] < needed_j:
            continue
        if _is_dominated(task, memory, other, FIRST_ON_GROUND, row, missing_j):
            return True
        if not on_ground and _is_dominated(task, memory, other, FIRST_IN_AIR, row, missing_j):
            return True
    return False


@kernel
def _insert(memory: Memory, label: int, state: int, column: int, before: int) -> None:
    """Enter a label into a list behind this one, or as the first."""
    row = memory.label[label]
    most_j = row[LAST_LEVEL] - row[USED]
    if before < 0:
        following = memory.state[state, column]
        memory.state[state, column] = label
    else:
        following = int64(memory.next_label[before, NEXT])
        memory.next_label[before, NEXT] = label
        later = memory.state[state, column]
        while later != label:
            _raise_most(memory, later, most_j)
            later = int64(memory.next_label[later, NEXT])
    memory.next_label[label, NEXT] = following
    memory.most_before_j[label, MOST_BEFORE] = (
        memory.most_before_j[following, MOST_BEFORE] if following >= 0 else -np.inf
    )
    _raise_most(memory, label, most_j)


@kernel
def _raise_most(memory: Memory, label: int, most_j: float) -> None:
    """Note that a label from here to the end of the list has this charge, rounded up."""
    if memory.most_before_j[label, MOST_BEFORE] < most_j:
        memory.most_before_j[label, MOST_BEFORE] = most_j + abs(most_j) * _ROUNDS_UP


@kernel
def _missing_j(task: Task, memory: Memory, state: int, row: Floats) -> float:
    """The least that a drone of this label charges on later pads; 0 where it does not matter."""
    if task.lag_s_per_j == 0.0:
        return 0.0
    flown_j = task.flown_j_of_need * (memory.state_bound[state, 1] - task.need_of_stops)
    return flown_j - (row[LAST_LEVEL] - row[USED] - task.reserve_j)


@kernel
def _is_dominated(
    task: Task, memory: Memory, state: int, column: int, row: Floats, missing_j: float
) -> bool:
    """Whether a label of this list dominates the row."""
    needed_j = row[LAST_LEVEL] - row[USED] - task.rounding_j
    label = memory.state[state, column]
    while label >= 0:
        other = memory.label[label]
        if memory.most_before_j[label, MOST_BEFORE] < needed_j:
            return False
        if dominates(task, other, row, missing_j):
            return True
        label = int64(memory.next_label[label, NEXT])
    return False


@kernel
def _compare(
    task: Task,
    memory: Memory,
    state: int,
    column: int,
    row: Floats,
    may_lose: bool,
    may_win: bool,
) -> int:
    """Remove the labels that this row dominates from a list; `_BEATEN` if one dominates the row.

    Otherwise returns the label after which the row belongs, -1 if the row is the first.
    """
    needed_j = row[LAST_LEVEL] - row[USED] - task.rounding_j
    rank = rank_s(task, row)
    missing_j = _missing_j(task, memory, state, row)
    behind, before = NONE, NONE
    label = memory.state[state, column]
    while label >= 0:
        other = memory.label[label]
        following = int64(memory.next_label[label, NEXT])
        other_rank = rank_s(task, other)
        is_earlier = other_rank < rank - SAME_S
        has_enough = memory.most_before_j[label, MOST_BEFORE] >= needed_j
        if (is_earlier or not may_win) and not (may_lose and has_enough):
            return behind
        if may_lose and has_enough and dominates(task, other, row, missing_j):
            return _BEATEN
        if (
            may_win
            and not is_earlier
            and dominates(task, row, other, _missing_j(task, memory, state, other))
        ):
            memory.link[label, ALIVE] = 0
            if before < 0:
                memory.state[state, column] = following
            else:
                memory.next_label[before, NEXT] = following
        else:
            before = label
            if other_rank > rank:
                behind = label
        label = following
    return behind
