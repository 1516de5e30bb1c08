"""Recharging: from a label on the ground to the labels that stand on a pad.

The amount stays open until a flight needs the charge. The search enters one session at a time. The
session at the next window follows when its turn in the queue comes.
"""

import numpy as np

from skyway.planner.kernels.charging import (
    Charge,
    after_staying,
    curve_at,
    end_of_curve_s,
    level_at,
    position_of,
    worth_staying_s,
)
from skyway.planner.kernels.closures import slack_s
from skyway.planner.kernels.compiler import kernel
from skyway.planner.kernels.labels import (
    DOMINATED,
    FULL_MEMORY,
    TOO_LATE,
    charge_of,
    enlist,
    enqueue,
    note,
)
from skyway.planner.kernels.memory import (
    ALIVE,
    DETAIL,
    FIRST_ON_GROUND,
    LAST_POSITION,
    LEVEL,
    PARENT,
    POSITION,
    SESSION,
    STATE,
    STATE_PLACE,
    TIME,
    USED,
    Memory,
)
from skyway.planner.kernels.pads import windows_of
from skyway.planner.kernels.records import Search, Task
from skyway.planner.kernels.states import state_of


@kernel
def enter_sessions(search: Search, label: int, place: int, mask: int) -> bool:
    """Enter the first sessions of a drone that stands here; False when the memory is full."""
    task, memory = search.task, search.memory
    first = windows_of(search, place)
    if first < 0:
        return False
    if memory.window_count[place] == 0:
        return True
    state = state_of(search, place, mask)
    if state < 0:
        return False
    if task.recharges_fully:
        return _enter_full(task, memory, label, place, state)
    end = first + memory.window_count[place]
    window = _first_until(memory, first, end, memory.label[label, TIME])
    return _enter_session(task, memory, label, state, window, end)


@kernel
def _first_until(memory: Memory, first: int, end: int, moment_s: float) -> int:
    """The first of these windows that ends after this moment; no window lies within another."""
    after = end
    while first < after:
        middle = (first + after) // 2
        if memory.window_s[middle, 1] <= moment_s:
            first = middle + 1
        else:
            after = middle
    return first


@kernel
def enter_next_sessions(task: Task, memory: Memory, label: int) -> None:
    """Enter the session at the next window: after this one, and in place of it."""
    state = memory.link[label, STATE]
    place = memory.state[state, STATE_PLACE]
    window = memory.link[label, DETAIL] + 1
    end = memory.window_first[place] + memory.window_count[place]
    if window >= end:
        return
    if memory.link[label, ALIVE] == 1:
        _enter_session(task, memory, label, state, window, end)
    parent = memory.link[label, PARENT]
    waited_s = memory.label[label, TIME] - memory.label[parent, TIME]
    left_s = memory.label[parent, LAST_POSITION] - memory.label[parent, POSITION]
    if waited_s < left_s:
        _enter_session(task, memory, parent, state, window, end)


@kernel
def _enter_session(
    task: Task, memory: Memory, label: int, state: int, window: int, end: int
) -> bool:
    """Enter the first useful session from this window on; False when full.

    While the drone waits for a window it may stay longer on the pad before. It also stays there as
    long as that pad charges faster than this one; other labels stand for a shorter stay.
    """
    time_s, used_j = memory.label[label, TIME], memory.label[label, USED]
    charge = charge_of(memory, label)
    top_j = task.curve_j[task.curve_j.size - 1]
    curve = curve_at(task, memory.row[memory.state[state, STATE_PLACE]])
    ready_s = time_s
    if task.levels == 0:
        ready_s += worth_staying_s(task, charge, curve)
    while window < end:
        start_s = max(ready_s, memory.window_s[window, 0])
        room_s = memory.window_s[window, 1] - start_s
        if room_s <= 0.0:
            window += 1
            continue
        stayed = after_staying(task, charge, start_s - time_s)
        charge_j = stayed.level - used_j
        if charge_j >= top_j - task.rounding_j:
            return True
        if task.levels > 0:
            if not _enter_levels(
                task, memory, label, state, curve, window, start_s, charge_j, room_s
            ):
                return False
        else:
            entered = _enter_open(
                task, memory, label, state, curve, window, start_s, charge_j, room_s
            )
            if entered == FULL_MEMORY:
                return False
            if entered == TOO_LATE:
                return True
            if entered >= 0:
                enqueue(task, memory, entered)
                return True
        if stayed.position >= charge.last_position:
            return True
        window += 1
    return True


@kernel
def _enter_open(
    task: Task,
    memory: Memory,
    label: int,
    state: int,
    curve: int,
    window: int,
    start_s: float,
    charge_j: float,
    room_s: float,
) -> int:
    """Enter a session with an open end; returns the label, or the reason for no label."""
    position = position_of(task, curve, charge_j)
    last_position = min(position + room_s, end_of_curve_s(task, curve))
    last_level = level_at(task, last_position)
    if last_level <= charge_j + task.rounding_j:
        return DOMINATED
    charge = Charge(position, charge_j, last_position, last_level)
    session = note(memory, label, SESSION, window, start_s, charge, 0.0, np.inf, start_s)
    if session == FULL_MEMORY:
        return FULL_MEMORY
    return enlist(task, memory, session, state, FIRST_ON_GROUND)


@kernel
def _enter_levels(
    task: Task,
    memory: Memory,
    label: int,
    state: int,
    curve: int,
    window: int,
    start_s: float,
    charge_j: float,
    room_s: float,
) -> bool:
    """Enter a session for each of some fixed levels, as planners without lazy charging do."""
    position = position_of(task, curve, charge_j)
    top_j = task.curve_j[task.curve_j.size - 1]
    for number in range(1, task.levels + 1):
        level_j = task.reserve_j + (top_j - task.reserve_j) * number / task.levels
        reached = position_of(task, curve, level_j)
        if level_j <= charge_j + task.rounding_j or reached - position > room_s:
            continue
        end_s = start_s + reached - position
        if not _enter_until(task, memory, label, state, curve, window, start_s, end_s, level_j):
            return False
    return True


@kernel
def _enter_full(task: Task, memory: Memory, label: int, place: int, state: int) -> bool:
    """Enter the session to the top that ends first; False when full."""
    row = memory.label[label]
    charge_j = row[LEVEL] - row[USED]
    top_j = task.curve_j[task.curve_j.size - 1]
    if charge_j >= top_j - task.rounding_j:
        return True
    curve = curve_at(task, memory.row[place])
    duration_s = position_of(task, curve, top_j) - position_of(task, curve, charge_j)
    first = memory.window_first[place]
    end = first + memory.window_count[place]
    full_s = row[TIME] + duration_s
    for window in range(_first_until(memory, first, end, full_s - 2.0 * slack_s(full_s)), end):
        start_s = max(row[TIME], memory.window_s[window, 0])
        end_s = start_s + duration_s
        free_until_s = memory.window_s[window, 1]
        if end_s <= free_until_s + slack_s(free_until_s):
            return _enter_until(task, memory, label, state, curve, window, start_s, end_s, top_j)
    return True


@kernel
def _enter_until(
    task: Task,
    memory: Memory,
    label: int,
    state: int,
    curve: int,
    window: int,
    start_s: float,
    end_s: float,
    level_j: float,
) -> bool:
    """Enter a session that ends with this level; False when full."""
    position = position_of(task, curve, level_j)
    charge = Charge(position, level_j, position, level_j)
    session = note(memory, label, SESSION, window, end_s, charge, 0.0, np.inf, start_s)
    if session == FULL_MEMORY:
        return False
    if enlist(task, memory, session, state, FIRST_ON_GROUND) >= 0:
        enqueue(task, memory, session)
    return True
