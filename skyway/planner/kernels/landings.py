"""Flying over a station, and landing there to recharge or to wait."""

import numpy as np

from skyway.planner.kernels.charging import Charge, after_raising, after_staying, until_left
from skyway.planner.kernels.closures import (
    lands_for_free,
    leave_latest_s,
    leave_s,
    slack_s,
)
from skyway.planner.kernels.compiler import kernel
from skyway.planner.kernels.hand_overs import act_at
from skyway.planner.kernels.labels import (
    FULL_MEMORY,
    charge_of,
    enlist,
    enqueue,
    note,
    ready_s,
)
from skyway.planner.kernels.memory import (
    FIRST_IN_AIR,
    FIRST_ON_GROUND,
    FLOWN,
    FLOWN_IN,
    KIND,
    LANDED,
    LATEST,
    NONE,
    STATE,
    STATE_MASK,
    STATE_PLACE,
    TIME,
    USED,
)
from skyway.planner.kernels.records import Search
from skyway.planner.kernels.sessions import enter_sessions
from skyway.planner.kernels.states import state_of
from skyway.planner.kernels.weather import has_weather


@kernel
def fly_over(
    search: Search,
    label: int,
    mask: int,
    arc: int,
    place: int,
    time_s: float,
    charge: Charge,
    used_j: float,
    latest_s: float,
    not_before_s: float,
    period: int,
) -> bool:
    """Enter the label above a station; False when the memory is full."""
    task, memory = search.task, search.memory
    state = state_of(search, place, mask)
    if state < 0:
        return False
    is_free = lands_for_free(search, place, time_s)
    if is_free:
        latest_s = np.inf
    flown = note(memory, label, FLOWN, arc, time_s, charge, used_j, latest_s, not_before_s)
    if flown == FULL_MEMORY:
        return False
    if has_weather(search.skyway):
        memory.period[flown, FLOWN_IN] = period
    if enlist(task, memory, flown, state, FIRST_ON_GROUND if is_free else FIRST_IN_AIR) >= 0:
        enqueue(task, memory, flown)
    return True


@kernel
def stand(search: Search, label: int) -> bool:
    """Enter the labels of a drone that lands and recharges here; False when the memory is full.

    The search does so when it takes the label from the queue. Most labels never leave the queue.
    """
    memory = search.memory
    state = memory.link[label, STATE]
    place, mask = memory.state[state, STATE_PLACE], memory.state[state, STATE_MASK]
    if memory.link[label, KIND] == FLOWN and not lands_for_free(
        search, place, memory.label[label, TIME]
    ):
        return _land(search, label, place, mask, state)
    return enter_sessions(search, label, place, mask)


@kernel
def _land(search: Search, label: int, place: int, mask: int, state: int) -> bool:
    """Enter the labels on the ground below a label in the air; False when the memory is full."""
    task, closed, memory = search.task, search.closed, search.memory
    row = memory.label[label]
    used_j = row[USED] + task.stop_j
    charge = after_raising(task, charge_of(memory, label), task.reserve_j + used_j)
    if charge.position < 0.0:
        return True
    soonest_s = ready_s(memory, label, charge)
    landing = closed.first_station_key + memory.row[place]
    may_be_closed = closed.keys.size > 0
    must_enlist = (
        may_be_closed
        or has_weather(search.skyway)
        or (task.may_pass and act_at(task, memory, place, mask) >= 0)
    )
    touch_s = soonest_s
    while True:
        latest_s = np.inf
        if may_be_closed:
            touch_s = leave_s(closed, NONE, landing, touch_s, 0.0, task.stop_s)
            if touch_s > row[LATEST] + slack_s(touch_s) or touch_s == np.inf:
                return True
            latest_s = leave_latest_s(closed, NONE, landing, touch_s, 0.0, task.stop_s)
        stayed = after_staying(task, charge, touch_s - soonest_s)
        limited = until_left(task, stayed, latest_s - touch_s)
        not_before_s = touch_s if touch_s > soonest_s else -np.inf
        landed = note(
            memory,
            label,
            LANDED,
            NONE,
            touch_s + task.stop_s,
            limited,
            used_j,
            np.inf,
            not_before_s,
        )
        if landed == FULL_MEMORY:
            return False
        # A drone on the ground that does not charge only waits. That only helps near closures, for
        # better weather, and where packages change hands.
        if not must_enlist:
            if not enter_sessions(search, landed, place, mask):
                return False
        elif enlist(task, memory, landed, state, FIRST_ON_GROUND) >= 0:
            enqueue(task, memory, landed)
        if stayed.position >= charge.last_position or latest_s == np.inf:
            return True
        touch_s = latest_s + 2.0 * slack_s(latest_s + task.stop_s)
