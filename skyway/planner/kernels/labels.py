"""Labels, their states and their queue: what is worth keeping, and what comes next.

A label stands for a function, the most charge at each moment, because how long to stay at the last
pad is decided later. A state is a place and a mask; each keeps its undominated labels in two
lists, those on the ground and those in the air: who stands can do all that who flies can, and wait.
"""

import numpy as np

from skyway.planner.kernels.bounds import note_bounds
from skyway.planner.kernels.charging import full_sessions_s, level_at
from skyway.planner.kernels.compiler import entrance, kernel
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
    NOT_BEFORE,
    PARENT,
    POSITION,
    QUEUE,
    SEARCHED,
    STATE,
    STATE_MASK,
    STATE_PLACE,
    STATES,
    TIME,
    USED,
    Closed,
    Memory,
    Skyway,
    Task,
)
from skyway.planner.kernels.places import slot_of

# Two moments closer than this are one: what dominance may lose in a whole plan stays far below
# the planner's tolerance of 1e-6 s.
_SAME_S = 1e-10

DOMINATED = -1
FULL_MEMORY = -2
TOO_LATE = -3


@kernel
def state_of(
    skyway: Skyway, task: Task, closed: Closed, memory: Memory, place: int, mask: int
) -> int:
    """The state of this place and mask, noted with its bounds if new; -1 when full."""
    key = (np.int64(place) << 13) | mask
    slot = slot_of(key, memory.state_table.size)
    while memory.state_table[slot] != 0:
        state = memory.state_table[slot] - 1
        if memory.state[state, STATE_PLACE] == place and memory.state[state, STATE_MASK] == mask:
            return state
        slot = (slot + 1) & (memory.state_table.size - 1)
    state = memory.count[STATES]
    if state >= memory.state.shape[0]:
        memory.count[FULL] = 1
        return -1
    if not note_bounds(skyway, task, closed, memory, state, place, mask):
        return -1
    memory.state_table[slot] = state + 1
    memory.state[state, STATE_PLACE] = place
    memory.state[state, STATE_MASK] = mask
    memory.state[state, FIRST_ON_GROUND] = -1
    memory.state[state, FIRST_IN_AIR] = -1
    memory.count[STATES] = state + 1
    if memory.is_searched[place] == 0:
        memory.is_searched[place] = 1
        memory.count[SEARCHED] += 1
    return state


@entrance
def refill_state_table(memory: Memory) -> None:
    """Enter all states into an empty table."""
    for state in range(memory.count[STATES]):
        key = (np.int64(memory.state[state, STATE_PLACE]) << 13) | memory.state[state, STATE_MASK]
        slot = slot_of(key, memory.state_table.size)
        while memory.state_table[slot] != 0:
            slot = (slot + 1) & (memory.state_table.size - 1)
        memory.state_table[slot] = state + 1


@kernel
def key_of(
    task: Task, memory: Memory, state: int, time_s: float, charge_j: float
) -> float:
    """The least moment of the last delivery that a drone here and now can still reach."""
    return time_s + still_s(task, memory, state, charge_j)


@kernel
def still_s(task: Task, memory: Memory, state: int, charge_j: float) -> float:
    """The least time until the last delivery, with this charge on board."""
    flight_s, need = memory.state_bound[state, 0], memory.state_bound[state, 1]
    usable_j = charge_j - task.reserve_j
    if task.recharges_fully:
        return flight_s + full_sessions_s(task, need - usable_j)
    return max(flight_s, need - usable_j * task.s_per_j)


@kernel
def note(
    memory: Memory,
    parent: int,
    kind: int,
    detail: int,
    time_s: float,
    position: float,
    level: float,
    last_position: float,
    last_level: float,
    used_j: float,
    latest_s: float,
    not_before_s: float,
) -> int:
    """Write a label that stands in no list yet; -2 when the memory is full."""
    label = memory.count[LABELS]
    if label >= memory.label.shape[0]:
        memory.count[FULL] = 1
        return FULL_MEMORY
    row = memory.label[label]
    row[TIME] = time_s
    row[POSITION] = position
    row[LEVEL] = level
    row[LAST_POSITION] = last_position
    row[LAST_LEVEL] = last_level
    row[USED] = used_j
    row[LATEST] = latest_s
    row[NOT_BEFORE] = not_before_s
    link = memory.link[label]
    link[PARENT] = parent
    link[KIND] = kind
    link[DETAIL] = detail
    link[STATE] = -1
    link[NEXT] = -1
    link[ALIVE] = 0
    memory.count[LABELS] = label + 1
    return label


@kernel
def enlist(task: Task, memory: Memory, label: int, state: int, on_ground: bool) -> int:
    """Enter the newest label into its state's list; if it is dominated, unwrite it.

    Returns the label, or -1 when it is dominated, or -3 when nothing in time can follow.
    """
    row = memory.label[label]
    key = key_of(task, memory, state, row[TIME], row[LEVEL] - row[USED])
    if not key < memory.best_s[0] or key > task.latest_s:
        memory.count[LABELS] = label
        return TOO_LATE
    if task.prunes:
        if _is_dominated(task, memory, memory.state[state, FIRST_ON_GROUND], row) or (
            not on_ground and _is_dominated(task, memory, memory.state[state, FIRST_IN_AIR], row)
        ):
            memory.count[LABELS] = label
            return DOMINATED
        if on_ground:
            _weed(task, memory, state, FIRST_ON_GROUND, row)
        _weed(task, memory, state, FIRST_IN_AIR, row)
    column = FIRST_ON_GROUND if on_ground else FIRST_IN_AIR
    link = memory.link[label]
    link[STATE] = state
    link[ALIVE] = 1
    link[NEXT] = memory.state[state, column]
    memory.state[state, column] = label
    return label


@kernel
def delist(memory: Memory, label: int) -> None:
    """Take a label out of its list again: what should follow it found no room."""
    state = memory.link[label, STATE]
    memory.link[label, ALIVE] = 0
    for column in (FIRST_ON_GROUND, FIRST_IN_AIR):
        before = -1
        other = memory.state[state, column]
        while other >= 0:
            if other == label:
                if before < 0:
                    memory.state[state, column] = memory.link[label, NEXT]
                else:
                    memory.link[before, NEXT] = memory.link[label, NEXT]
                return
            before = other
            other = memory.link[other, NEXT]


@kernel
def _is_dominated(task, memory, first, row):
    label = first
    while label >= 0:
        if dominates(task, memory.label[label], row):
            return True
        label = memory.link[label, NEXT]
    return False


@kernel
def _weed(task, memory, state, column, row):
    """Take out of a list what this label dominates."""
    before = -1
    label = memory.state[state, column]
    while label >= 0:
        following = memory.link[label, NEXT]
        if dominates(task, row, memory.label[label]):
            memory.link[label, ALIVE] = 0
            if before < 0:
                memory.state[state, column] = following
            else:
                memory.link[before, NEXT] = following
        else:
            before = label
        label = following


@kernel
def dominates(task: Task, one: np.ndarray, other: np.ndarray) -> bool:
    """Whether `one` has at least the charge of `other` at each moment of `other`.

    With one concave charge curve for all pads nothing between the first and the last moment can
    cross, so those two are enough.
    """
    later_s = other[TIME] - one[TIME]
    if later_s < -_SAME_S or one[LATEST] < other[LATEST] - _SAME_S:
        return False
    least = task.rounding_j * 1e-3
    lead_at_end = (one[LAST_LEVEL] - one[USED]) - (other[LAST_LEVEL] - other[USED])
    if lead_at_end < -least:
        return False
    position = one[POSITION] + max(later_s, 0.0)
    level = one[LAST_LEVEL]
    if position < one[LAST_POSITION]:
        level = one[LEVEL] if later_s <= 0.0 else level_at(task, position)
    if level - one[USED] < other[LEVEL] - other[USED] - least:
        return False
    position += other[LAST_POSITION] - other[POSITION]
    if position >= one[LAST_POSITION]:
        return True
    return level_at(task, position) - one[USED] >= other[LAST_LEVEL] - other[USED] - least


@kernel
def push(task: Task, memory: Memory, label: int) -> None:
    """Put a label of a list into the queue."""
    row = memory.label[label]
    left_s = still_s(task, memory, memory.link[label, STATE], row[LEVEL] - row[USED])
    push_with(memory, label, row[TIME] + task.weight * left_s)


@kernel
def push_with(memory: Memory, label: int, key: float) -> None:
    """Put a label into the queue; of equal keys the newer label comes first."""
    keys, labels = memory.queue_key, memory.queue_label
    slot = memory.count[QUEUE]
    memory.count[QUEUE] = slot + 1
    while slot > 0:
        above = (slot - 1) >> 1
        if keys[above] < key or (keys[above] == key and labels[above] > label):
            break
        keys[slot] = keys[above]
        labels[slot] = labels[above]
        slot = above
    keys[slot] = key
    labels[slot] = label


@kernel
def pop(memory: Memory) -> int:
    """Take the label with the least key out of the queue."""
    keys, labels = memory.queue_key, memory.queue_label
    taken = labels[0]
    size = memory.count[QUEUE] - 1
    memory.count[QUEUE] = size
    key, label = keys[size], labels[size]
    slot = 0
    while True:
        below = 2 * slot + 1
        if below >= size:
            break
        right = below + 1
        if right < size and (
            keys[right] < keys[below]
            or (keys[right] == keys[below] and labels[right] > labels[below])
        ):
            below = right
        if key < keys[below] or (key == keys[below] and label > labels[below]):
            break
        keys[slot] = keys[below]
        labels[slot] = labels[below]
        slot = below
    keys[slot] = key
    labels[slot] = label
    return taken


@kernel
def note_goal(memory: Memory, label: int, delivered_s: float) -> None:
    """Keep a label that has delivered everything, if it is the earliest so far."""
    if delivered_s < memory.best_s[0]:
        memory.best_s[0] = delivered_s
        memory.count[BEST] = label
