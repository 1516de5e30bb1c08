"""Picking up and handing over within windows, by a drone that stands at the place already.

A problem with windows lets a drone pass a place where packages change hands, and wait or recharge
there first. So each change of hands is a step of its own, made by a drone on the ground.
"""

import numpy as np

from skyway.planner.kernels.charging import after_raising, after_staying, until_left
from skyway.planner.kernels.closures import lands_for_free
from skyway.planner.kernels.compiler import kernel
from skyway.planner.kernels.labels import (
    FULL_MEMORY,
    charge_of,
    enlist,
    enqueue,
    note,
    note_goal,
    ready_s,
)
from skyway.planner.kernels.memory import (
    FIRST_ON_GROUND,
    FLOWN,
    KIND,
    NONE,
    STAYED,
    TIME,
    USED,
    Memory,
    int64,
)
from skyway.planner.kernels.records import Search, Task
from skyway.planner.kernels.states import state_of


@kernel
def act_at(task: Task, memory: Memory, place: int, mask: int) -> int:
    """What is left to do here: a destination's number, the pickup's, or -1 for nothing."""
    row = memory.row[place]
    count = int64(task.destinations.size)
    if mask == int64(1) << count:
        return count if row == task.source else NONE
    for number in range(count):
        if task.destinations[number] == row and not mask >> number & 1:
            return number if task.flight_after[mask, number] < np.inf else NONE
    return NONE


@kernel
def pick_up_or_hand_over(search: Search, label: int, place: int, mask: int) -> bool:
    """Enter the labels after the pickup or hand-over here, if any is due; False when full."""
    task, memory = search.task, search.memory
    act = act_at(task, memory, place, mask)
    if act < 0 or not _is_on_ground(search, label, place):
        return True
    count = int64(task.destinations.size)
    following = int64(0) if act == count else mask | int64(1) << act
    is_last = following == (int64(1) << count) - 1
    need_j = task.reserve_j + memory.label[label, USED]
    if is_last:
        need_j += task.finish_j_at_source if act == count else task.finish_j[act]
    charge = after_raising(task, charge_of(memory, label), need_j)
    if charge.position < 0.0:
        return True
    soonest_s = ready_s(memory, label, charge)
    takes_s = task.loading_s if act == count else task.dropoff_s
    for window in range(task.start_offsets[act], task.start_offsets[act + 1]):
        from_s, until_s = task.start_from_s[window], task.start_until_s[window]
        start_s = max(soonest_s, from_s)
        if start_s > until_s:
            continue
        # While the drone waits it may stay longer on the pad before, but not past the window.
        stayed = charge if is_last else after_staying(task, charge, start_s - soonest_s)
        limited = until_left(task, stayed, until_s - start_s)
        done = note(
            memory,
            label,
            STAYED,
            NONE,
            start_s + takes_s,
            limited,
            memory.label[label, USED],
            np.inf,
            from_s,
        )
        if done == FULL_MEMORY:
            return False
        if is_last:
            if start_s + takes_s <= task.latest_s:
                note_goal(memory, done, start_s + takes_s)
            return True
        if not _enter(search, done, place, following):
            return False
        # A later window only helps if the pad before gives more charge meanwhile.
        if limited.last_position >= charge.last_position:
            return True
    return True


@kernel
def _enter(search: Search, label: int, place: int, mask: int) -> bool:
    """Enter a label after a change of hands; False when the memory is full."""
    task, memory = search.task, search.memory
    state = state_of(search, place, mask)
    if state < 0:
        return False
    if enlist(task, memory, label, state, FIRST_ON_GROUND) >= 0:
        enqueue(task, memory, label)
    return True


@kernel
def _is_on_ground(search: Search, label: int, place: int) -> bool:
    memory = search.memory
    if memory.link[label, KIND] != FLOWN:
        return True
    return lands_for_free(search, place, memory.label[label, TIME])
