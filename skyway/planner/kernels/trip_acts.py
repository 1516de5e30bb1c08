"""The acts of a trip's best plan, which are flown again for times, energy and pad sessions.

`skyway.planner.exact_itinerary` makes the steps of a plan from the same acts.
"""

import numpy as np

from skyway.planner.kernels.charging import curve_at, position_of
from skyway.planner.kernels.compiler import kernel
from skyway.planner.kernels.memory import (
    BEST,
    DETAIL,
    FLOWN,
    HANDED_OVER,
    KIND,
    LANDED,
    LEVEL,
    NONE,
    PARENT,
    SESSION,
    START,
    STAYED,
    USED,
    int64,
)
from skyway.planner.kernels.pads import end_of, first_of
from skyway.planner.kernels.records import Book, Found, Search, Terms, TripRows
from skyway.planner.kernels.trip_tasks import Drops
from skyway.units import TIME_TOLERANCE_S

_MS_PER_S = 1000.0
# See `skyway.planner.pad_book`: moments this close to a whole millisecond are that millisecond.
_MS_TOLERANCE = TIME_TOLERANCE_S * _MS_PER_S

# Rows of `Found.counts`.
DONE = 0
ACTS = 1
SESSIONS = 2

# Joules closer than this share of the tolerance of charges are equal.
_SAME_SHARE = 1e-3


@kernel
def keep_acts(search: Search, found: Found) -> int:
    """Write the acts of the best plan in order of time; their number, or -1 without room."""
    memory, task = search.memory, search.task
    count = int64(0)
    label = memory.counts[BEST]
    while label != NONE:
        count += 1
        label = memory.link[label, PARENT]
    first = found.counts[ACTS]
    if first + count > found.act_link.shape[0]:
        return NONE
    label = memory.counts[BEST]
    left_with_j = memory.label[label, LEVEL]
    index = first + count
    while label != NONE:
        index -= 1
        kind, parent = memory.link[label, KIND], memory.link[label, PARENT]
        segment, level_j = NONE, np.nan
        if kind in (FLOWN, HANDED_OVER):
            segment = memory.link[label, DETAIL]
        elif kind == SESSION:
            own_j = memory.label[label, LEVEL]
            level_j = own_j if task.recharges_fully else left_with_j
            left_with_j = own_j + memory.label[parent, USED]
        found.act_link[index, 0] = kind
        found.act_link[index, 1] = segment
        found.act_value[index, 0] = level_j
        found.act_value[index, 1] = memory.not_before_s[label]
        label = parent
    found.counts[ACTS] = first + count
    return count


@kernel
def fly_acts(
    search: Search, terms: Terms, trips: TripRows, found: Found, trip: int, drops: Drops
) -> bool:
    """Fly the acts of this trip and write the results; False without room."""
    task, memory = search.task, search.memory
    count = int64(drops.row.size)
    mask = int64(1) << count
    here = int64(trips.start[trip])
    now_s, charge_j, used_j = task.begin_s, task.start_j, 0.0
    first_session = found.counts[SESSIONS]
    for index in range(found.act_offsets[trip], found.counts[ACTS]):
        kind, arc = found.act_link[index, 0], found.act_link[index, 1]
        not_before_s = found.act_value[index, 1]
        if kind in (FLOWN, HANDED_OVER):
            flight_j = memory.arc_length[arc] * task.j_per_m[mask]
            now_s = max(now_s, not_before_s) + memory.arc_length[arc] * task.s_per_m[mask]
            charge_j -= flight_j
            used_j += flight_j
            here = memory.row[memory.arc_place[arc]]
            found.act_link[index, 1] = memory.arc_segment[arc]
        elif kind != START:
            now_s = max(now_s, not_before_s)
        if kind in (LANDED, HANDED_OVER):
            now_s += task.stop_s
            charge_j -= task.stop_j
            used_j += task.stop_j
        elif kind == SESSION:
            level_j = min(found.act_value[index, 0], task.curve_j[task.curve_j.size - 1])
            if level_j > charge_j + task.rounding_j * _SAME_SHARE:
                curve = curve_at(task, here)
                position = position_of(task, curve, level_j)
                until_s = now_s + position - position_of(task, curve, charge_j)
                if not _hold_pads(search, found, here, now_s, until_s):
                    found.counts[SESSIONS] = first_session
                    return False
                now_s, charge_j = until_s, level_j
        loads_at_start = kind == START and here == task.source and not task.may_pass
        if kind in (HANDED_OVER, STAYED) or loads_at_start:
            picks_up = mask == int64(1) << count
            now_s += task.loading_s if picks_up else task.dropoff_s
            mask = int64(0) if picks_up else mask
            for package in range(trips.package_offsets[trip], trips.package_offsets[trip + 1]):
                if trips.destination[package] == here:
                    found.delivered_s[package] = now_s
            for number in range(count):
                if drops.row[number] == here and not picks_up:
                    mask |= int64(1) << number
    found.end_row[trip] = here
    found.end_s[trip] = now_s
    found.left_j[trip] = charge_j
    found.used_j[trip] = used_j
    return True


@kernel
def _hold_pads(search: Search, found: Found, row: int, from_s: float, until_s: float) -> bool:
    """Write the sessions from one moment to another, pad after pad; False without room.

    The pads are those that `PadCalendar` chooses: for a full recharge the first pad that is free
    for the whole time, otherwise the pad that stays free longest.
    """
    now_ms = int64(np.floor(from_s * _MS_PER_S + _MS_TOLERANCE))
    end_ms = int64(np.ceil(until_s * _MS_PER_S - _MS_TOLERANCE))
    pads = int64(search.skyway.pads[row])
    while now_ms < end_ms:
        longest_ms, chosen = now_ms, NONE
        for pad in range(pads):
            free_ms = min(
                _free_until_ms(search.given, row, pad, now_ms, end_ms),
                _free_until_ms(search.known, row, pad, now_ms, end_ms),
            )
            if free_ms > longest_ms:
                longest_ms, chosen = free_ms, int64(pad)
        if chosen == NONE:
            return True
        session = found.counts[SESSIONS]
        if session >= found.session.shape[0]:
            return False
        found.session[session, 0] = row
        found.session[session, 1] = chosen
        found.session[session, 2] = now_ms
        found.session[session, 3] = longest_ms
        found.counts[SESSIONS] = session + 1
        now_ms = longest_ms
    return True


@kernel
def _free_until_ms(book: Book, row: int, pad: int, now_ms: int, end_ms: int) -> int:
    """The moment until which the pad stays free, at most the end; now if the pad is taken."""
    first = first_of(book, row)
    free_ms = end_ms
    for index in range(first, end_of(book, row, first)):
        if book.pad[index] != pad or book.end_ms[index] - book.zero_ms <= now_ms:
            continue
        free_ms = min(free_ms, max(book.start_ms[index] - book.zero_ms, now_ms))
    return free_ms
