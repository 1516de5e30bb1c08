"""Flying, landing and handing over: from a label to the labels at the ends of its segments."""

import numpy as np

from skyway.planner.kernels.charging import after_raising, after_staying
from skyway.planner.kernels.closures import leave_latest_s, leave_s
from skyway.planner.kernels.compiler import kernel
from skyway.planner.kernels.labels import (
    FULL_MEMORY,
    delist,
    enlist,
    note,
    note_goal,
    push,
    state_of,
)
from skyway.planner.kernels.memory import (
    ALIVE,
    FLOWN,
    HANDED_OVER,
    LANDED,
    LAST_LEVEL,
    LAST_POSITION,
    LATEST,
    LEVEL,
    OUTWARD,
    POSITION,
    STATE,
    STATE_MASK,
    STATE_PLACE,
    TIME,
    USED,
    Book,
    Closed,
    Memory,
    Skyway,
    Task,
)
from skyway.planner.kernels.places import arcs_of
from skyway.planner.kernels.sessions import enter_sessions


@kernel
def expand(
    skyway: Skyway, task: Task, closed: Closed, given: Book, known: Book, memory: Memory, label: int
) -> bool:
    """Enter all labels one segment further; False when the memory is full."""
    state = memory.link[label, STATE]
    place, mask = memory.state[state, STATE_PLACE], memory.state[state, STATE_MASK]
    first = arcs_of(skyway, closed, memory, place, OUTWARD)
    if first < 0:
        return False
    for arc in range(first, first + memory.arc_count[place, OUTWARD]):
        if not _fly(skyway, task, closed, given, known, memory, label, mask, arc):
            return False
    return True


@kernel
def _fly(skyway, task, closed, given, known, memory, label, mask, arc):
    """Enter what follows one segment, for each time at which it is worth flying."""
    count = task.destinations.size
    on_approach = mask == 1 << count
    there = memory.arc_place[arc]
    row_there = memory.row[there]
    reached = _destination_at(task, row_there, mask)
    if reached >= 0 and task.flight_after[mask, reached] == np.inf:
        return True
    hands_over = reached >= 0 or (on_approach and row_there == task.source)
    is_last = reached >= 0 and mask | 1 << reached == (1 << count) - 1
    row = memory.label[label]
    flight_s = memory.arc_length[arc] * task.s_per_m[mask]
    used_j = row[USED] + memory.arc_length[arc] * task.j_per_m[mask]
    if hands_over:
        used_j += task.stop_j
    need_j = task.reserve_j + used_j
    if is_last:
        need_j += task.finish_j[reached]
    elif on_approach and count == 0 and hands_over:
        need_j += task.finish_j_at_source
    last_position, last_level = row[LAST_POSITION], row[LAST_LEVEL]
    position, level = after_raising(
        task, row[POSITION], row[LEVEL], last_position, last_level, need_j
    )
    if position < 0.0:
        return True
    leave_at_s = row[TIME] + position - row[POSITION]
    if closed.keys.size == 0:
        return _arrive(
            skyway, task, closed, given, known, memory, label, mask, arc, there, reached,
            hands_over, is_last, leave_at_s + flight_s, position, level, last_position, last_level,
            used_j, np.inf, -np.inf,
        )
    segment = memory.arc_segment[arc]
    landing = closed.first_station_key + row_there if hands_over else -1
    ready_s = leave_at_s
    while True:
        leave_at_s = leave_s(closed, segment, landing, leave_at_s, flight_s, task.stop_s)
        if leave_at_s > row[LATEST] or leave_at_s == np.inf:
            return True
        stayed, raised = after_staying(
            task, position, level, last_position, last_level, leave_at_s - ready_s
        )
        latest_s = leave_latest_s(closed, segment, landing, leave_at_s, flight_s, task.stop_s)
        most, most_level = after_staying(
            task, stayed, raised, last_position, last_level, latest_s - leave_at_s
        )
        not_before_s = leave_at_s if leave_at_s > ready_s else -np.inf
        if not _arrive(
            skyway, task, closed, given, known, memory, label, mask, arc, there, reached,
            hands_over, is_last, leave_at_s + flight_s, stayed, raised, most, most_level,
            used_j, min(row[LATEST], latest_s) + flight_s, not_before_s,
        ):
            return False
        # Who lands can wait there, so leaving after the next closure is worth it only for what the
        # last pad gives meanwhile; who flies on may meet something closed that is open by then.
        if latest_s == np.inf or (hands_over and stayed >= last_position):
            return True
        leave_at_s = np.nextafter(latest_s, np.inf)


@kernel
def _destination_at(task, row, mask):
    """The destination at this station that waits for its packages, or -1."""
    count = task.destinations.size
    if mask == 1 << count:
        return -1
    for number in range(count):
        if task.destinations[number] == row:
            return -1 if mask >> number & 1 else number
    return -1


@kernel
def _arrive(
    skyway, task, closed, given, known, memory, label, mask, arc, there, reached, hands_over,
    is_last, time_s, position, level, last_position, last_level, used_j, latest_s, not_before_s,
):
    """Enter the label at the end of a segment and what can be done there; False when full."""
    if not hands_over:
        return _pass(
            skyway, task, closed, given, known, memory, label, mask, arc, there, time_s, position,
            level, last_position, last_level, used_j, latest_s, not_before_s,
        )
    following = 0 if reached < 0 else mask | 1 << reached
    time_s += task.stop_s + (task.loading_s if reached < 0 else task.dropoff_s)
    is_done = is_last or (reached < 0 and task.destinations.size == 0)
    handed = note(
        memory, label, HANDED_OVER, arc, time_s, position, level, last_position, last_level,
        used_j, np.inf, not_before_s,
    )
    if handed == FULL_MEMORY:
        return False
    if is_done:
        if time_s <= task.latest_s:
            note_goal(memory, handed, time_s)
        return True
    state = state_of(skyway, task, closed, memory, there, following)
    if state < 0:
        return False
    if enlist(task, memory, handed, state, True) < 0:
        return True
    if not enter_sessions(
        skyway, task, closed, given, known, memory, handed, there, following
    ):
        delist(memory, handed)
        return False
    if memory.link[handed, ALIVE] == 1:
        push(task, memory, handed)
    return True


@kernel
def _pass(
    skyway, task, closed, given, known, memory, label, mask, arc, there, time_s, position,
    level, last_position, last_level, used_j, latest_s, not_before_s,
):
    """Enter the label above a station, and on the ground there; False when full."""
    state = state_of(skyway, task, closed, memory, there, mask)
    if state < 0:
        return False
    landing = closed.first_station_key + memory.row[there]
    # Where landing costs nothing and nothing forbids it, who is above is as good as on the ground.
    is_free = task.stop_s == 0.0 and task.stop_j == 0.0
    if is_free and closed.keys.size > 0:
        is_free = leave_latest_s(closed, -1, landing, time_s, 0.0, 0.0) == np.inf and (
            leave_s(closed, -1, landing, time_s, 0.0, 0.0) == time_s
        )
    flown = note(
        memory, label, FLOWN, arc, time_s, position, level, last_position, last_level, used_j,
        np.inf if is_free else latest_s, not_before_s,
    )
    if flown == FULL_MEMORY:
        return False
    if enlist(task, memory, flown, state, is_free) < 0:
        return True
    if is_free:
        if not enter_sessions(skyway, task, closed, given, known, memory, flown, there, mask):
            delist(memory, flown)
            return False
    elif not _land(skyway, task, closed, given, known, memory, flown, there, mask, state):
        delist(memory, flown)
        return False
    if memory.link[flown, ALIVE] == 1:
        push(task, memory, flown)
    return True


@kernel
def _land(skyway, task, closed, given, known, memory, label, place, mask, state):
    """Enter the labels on the ground below a label in the air; False when full."""
    row = memory.label[label]
    used_j = row[USED] + task.stop_j
    last_position, last_level = row[LAST_POSITION], row[LAST_LEVEL]
    position, level = after_raising(
        task, row[POSITION], row[LEVEL], last_position, last_level, task.reserve_j + used_j
    )
    if position < 0.0:
        return True
    ready_s = row[TIME] + position - row[POSITION]
    latest_arrival_s = row[LATEST]
    landing = closed.first_station_key + memory.row[place]
    may_wait = closed.keys.size > 0
    touch_s = ready_s
    while True:
        latest_s = np.inf
        if may_wait:
            touch_s = leave_s(closed, -1, landing, touch_s, 0.0, task.stop_s)
            if touch_s > latest_arrival_s or touch_s == np.inf:
                return True
            latest_s = leave_latest_s(closed, -1, landing, touch_s, 0.0, task.stop_s)
        stayed, raised = after_staying(
            task, position, level, last_position, last_level, touch_s - ready_s
        )
        most, most_level = after_staying(
            task, stayed, raised, last_position, last_level, latest_s - touch_s
        )
        landed = note(
            memory, label, LANDED, -1, touch_s + task.stop_s, stayed, raised, most, most_level,
            used_j, np.inf, touch_s if touch_s > ready_s else -np.inf,
        )
        if landed == FULL_MEMORY:
            return False
        # Who stands and does not charge only waits, which is of use only where things are closed.
        is_worth_it = True
        if may_wait:
            is_worth_it = enlist(task, memory, landed, state, True) >= 0
        if is_worth_it:
            if not enter_sessions(
                skyway, task, closed, given, known, memory, landed, place, mask
            ):
                if may_wait:
                    delist(memory, landed)
                return False
            if may_wait and memory.link[landed, ALIVE] == 1:
                push(task, memory, landed)
        if stayed >= last_position or latest_s == np.inf:
            return True
        touch_s = np.nextafter(latest_s, np.inf)
