"""Flying and handing over: from a label to the labels at the ends of its segments."""

from typing import NamedTuple

import numpy as np

from skyway.planner.kernels.charging import Charge, after_raising, after_staying, until_left
from skyway.planner.kernels.closures import leave_latest_s, leave_s, slack_s
from skyway.planner.kernels.compiler import kernel
from skyway.planner.kernels.hand_overs import pick_up_or_hand_over
from skyway.planner.kernels.labels import (
    FULL_MEMORY,
    charge_of,
    enlist,
    enqueue,
    note,
    note_goal,
    ready_s,
)
from skyway.planner.kernels.landings import fly_over
from skyway.planner.kernels.memory import (
    ALIVE,
    FIRST_ON_GROUND,
    FLOWN_IN,
    HANDED_OVER,
    LABELS,
    LATEST,
    NEW,
    NONE,
    OUTWARD,
    STATE,
    STATE_MASK,
    STATE_PLACE,
    USED,
    Memory,
    int64,
)
from skyway.planner.kernels.places import arcs_of, detours_after, is_detour
from skyway.planner.kernels.records import Search, Task
from skyway.planner.kernels.states import fetch_states, state_of
from skyway.planner.kernels.weather import Departures, air_of, first_period, has_weather

# The labels of a larger search do not fit into the processor's own caches.
_FAR_LABELS = 1 << 14


class _End(NamedTuple):
    """The end of an arc, and the hand-over there.

    `reached` is the destination at this place that waits for its packages, or -1. `following` is
    the mask after a delivery or after the pickup, or -1 without a hand-over. With windows there
    are no hand-overs here: `hand_overs` makes them.
    """

    place: int
    reached: int
    following: int


@kernel
def expand(search: Search, label: int, period: int) -> bool:
    """Enter all labels that lie one segment further; False when the memory is full.

    With weather: the labels of drones that leave in this period.
    """
    memory = search.memory
    state = memory.link[label, STATE]
    place, mask = memory.state[state, STATE_PLACE], memory.state[state, STATE_MASK]
    is_new = memory.link[label, ALIVE] == NEW
    if is_new and search.task.may_pass and not pick_up_or_hand_over(search, label, place, mask):
        return False
    first = arcs_of(search.skyway, search.closed, memory, place, OUTWARD)
    if first < 0:
        return False
    from_period = period
    if has_weather(search.skyway) and not is_new:
        from_period = first_period(search, label)
    detours = detours_after(search, label)
    if memory.counts[LABELS] >= _FAR_LABELS:
        fetch_states(memory, mask, first, memory.arc_count[place, OUTWARD], detours)
    for number in range(memory.arc_count[place, OUTWARD]):
        if is_detour(detours, number):
            continue
        if not _fly(search, label, mask, first + number, period, from_period):
            return False
    return True


@kernel
def _fly(search: Search, label: int, mask: int, arc: int, period: int, from_period: int) -> bool:
    """Enter the labels after one segment, one for each useful departure; False when full."""
    task, closed, memory = search.task, search.closed, search.memory
    end = _end_of(task, memory, mask, arc)
    if end.reached >= 0 and task.flight_after[mask, end.reached] == np.inf:
        return True
    has_hand_over = end.following >= 0
    row = memory.label[label]
    flight_m = memory.arc_length[arc]
    air = Departures(1.0, 1.0, -np.inf, np.inf)
    if has_weather(search.skyway):
        still_s = flight_m * task.s_per_m[mask]
        air = air_of(search.skyway, memory.arc_column[arc], period, from_period, still_s)
        if air.time_factor == np.inf:
            return True
        flight_m *= air.time_factor
    flight_s = flight_m * task.s_per_m[mask]
    used_j = row[USED] + flight_m * air.energy_factor * task.j_per_m[mask]
    if has_hand_over:
        used_j += task.stop_j
    need_j = task.reserve_j + used_j + _left_at_end_j(task, end)
    charge = after_raising(task, charge_of(memory, label), need_j)
    if charge.position < 0.0:
        return True
    soonest_s = ready_s(memory, label, charge)
    if closed.keys.size == 0 and air.until_s == np.inf and air.from_s <= soonest_s:
        return _arrive(
            search,
            label,
            mask,
            arc,
            end,
            soonest_s + flight_s,
            charge,
            used_j,
            row[LATEST] + flight_s,
            -np.inf,
            period,
        )
    segment = memory.arc_segment[arc]
    landing = closed.first_station_key + memory.row[end.place] if has_hand_over else NONE
    leave_at_s = max(soonest_s, air.from_s)
    while True:
        leave_at_s = leave_s(closed, segment, landing, leave_at_s, flight_s, task.stop_s)
        same_s = slack_s(leave_at_s + flight_s + task.stop_s)
        if leave_at_s > min(row[LATEST], air.until_s) + same_s or leave_at_s == np.inf:
            return True
        closes_s = leave_latest_s(closed, segment, landing, leave_at_s, flight_s, task.stop_s)
        latest_s = min(closes_s, air.until_s)
        stayed = after_staying(task, charge, leave_at_s - soonest_s)
        arrival_s, latest_arrival_s = leave_at_s + flight_s, min(row[LATEST], latest_s) + flight_s
        limited = until_left(task, stayed, latest_s - leave_at_s)
        not_before_s = leave_at_s if leave_at_s > soonest_s else -np.inf
        if not _arrive(
            search,
            label,
            mask,
            arc,
            end,
            arrival_s,
            limited,
            used_j,
            latest_arrival_s,
            not_before_s,
            period,
        ):
            return False
        # A drone that lands can wait there: leaving after the next closure only helps if the last
        # pad gives more charge meanwhile. A drone that flies on may meet a closure that then
        # is over.
        if closes_s >= air.until_s or (has_hand_over and stayed.position >= charge.last_position):
            return True
        leave_at_s = closes_s + 2.0 * same_s


@kernel
def _end_of(task: Task, memory: Memory, mask: int, arc: int) -> _End:
    place = memory.arc_place[arc]
    if task.may_pass:
        return _End(place, NONE, NONE)
    row = memory.row[place]
    count = int64(task.destinations.size)
    if mask == int64(1) << count:
        return _End(place, NONE, int64(0) if row == task.source else NONE)
    for number in range(count):
        if task.destinations[number] == row and not mask >> number & 1:
            return _End(place, number, mask | int64(1) << number)
    return _End(place, NONE, NONE)


@kernel
def _delivers_last(task: Task, end: _End) -> bool:
    """Whether all packages are delivered after this hand-over."""
    return end.following == (1 << task.destinations.size) - 1


@kernel
def _left_at_end_j(task: Task, end: _End) -> float:
    """The energy that must remain above the reserve if the plan ends there."""
    if not _delivers_last(task, end):
        return 0.0
    return task.finish_j[end.reached] if end.reached >= 0 else task.finish_j_at_source


@kernel
def _arrive(
    search: Search,
    label: int,
    mask: int,
    arc: int,
    end: _End,
    time_s: float,
    charge: Charge,
    used_j: float,
    latest_s: float,
    not_before_s: float,
    period: int,
) -> bool:
    """Enter the label at the end of a segment and the labels after it; False when full."""
    if end.following < 0:
        return fly_over(
            search,
            label,
            mask,
            arc,
            end.place,
            time_s,
            charge,
            used_j,
            latest_s,
            not_before_s,
            period,
        )
    task, memory = search.task, search.memory
    time_s += task.stop_s + (task.loading_s if end.reached < 0 else task.dropoff_s)
    handed = note(memory, label, HANDED_OVER, arc, time_s, charge, used_j, np.inf, not_before_s)
    if handed == FULL_MEMORY:
        return False
    if has_weather(search.skyway):
        memory.period[handed, FLOWN_IN] = period
    if _delivers_last(task, end):
        if time_s <= task.latest_s:
            note_goal(memory, handed, time_s)
        return True
    state = state_of(search, end.place, end.following)
    if state < 0:
        return False
    if enlist(task, memory, handed, state, FIRST_ON_GROUND) >= 0:
        enqueue(task, memory, handed)
    return True
