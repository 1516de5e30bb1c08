"""The free windows of a station's pads, computed when the search first stands there.

Under partial recharging a drone may change pads, so the windows are the times when any pad is free:
the union of the pads' windows. A full recharge needs one pad, so the windows stay separate. Those
that are too short for any full recharge, or lie within another window, are left out.
"""

import numpy as np

from skyway.planner.kernels.charging import curve_at, position_of
from skyway.planner.kernels.closures import slack_s
from skyway.planner.kernels.compiler import array_kernel, kernel
from skyway.planner.kernels.memory import FULL, NONE, WINDOWS, Floats, Longs, int64
from skyway.planner.kernels.records import Book, Search
from skyway.planner.kernels.weather import has_weather

_MS_PER_S = 1000.0

# No plan is longer, in seconds: its moments are compared with at most the tolerance of this one.
_LONGEST_S = 1e9

# A reservation that ends later than this has no end: a book's open end minus its zero moment.
_OPEN_MS = 1 << 61


@kernel
def first_of(book: Book, row: int) -> int:
    """The index of this station's first reservation, or where it would be."""
    low, high = 0, book.station.size
    while low < high:
        middle = (low + high) // 2
        if book.station[middle] < row:
            low = middle + 1
        else:
            high = middle
    return low


@kernel
def end_of(book: Book, row: int, first: int) -> int:
    """The index behind this station's last reservation."""
    end = first
    while end < book.station.size and book.station[end] == row:
        end += 1
    return end


@array_kernel
def windows_of(search: Search, place: int) -> int:
    """The first of this place's free windows; -1 when the memory is full."""
    given, known, memory = search.given, search.known, search.memory
    if memory.window_first[place] >= 0:
        return memory.window_first[place]
    row = memory.row[place]
    pads = int64(search.skyway.pads[row])
    first_given, first_known = first_of(given, row), first_of(known, row)
    end_given, end_known = end_of(given, row, first_given), end_of(known, row, first_known)
    reserved = end_given - first_given + end_known - first_known
    first = memory.counts[WINDOWS]
    if first + reserved + pads > memory.window_s.shape[0]:
        memory.counts[FULL] = 1
        return NONE
    if pads == 0:
        count = 0
    elif reserved == 0:
        memory.window_s[first, 0] = 0.0
        memory.window_s[first, 1] = np.inf
        count = 1
    else:
        pad = np.empty(reserved, np.int64)
        taken_ms = np.empty((reserved, 2), np.int64)
        unites = not search.task.recharges_fully
        least_s = 0.0 if unites else _least_session_s(search, row) - slack_s(_LONGEST_S)
        least_ms = int64(max(least_s, 0.0) * _MS_PER_S)
        end = _gather(given, first_given, end_given, pads, least_ms, int64(0), pad, taken_ms)
        end = _gather(known, first_known, end_known, pads, least_ms, end, pad, taken_ms)
        pad, taken_ms = pad[:end], taken_ms[:end]
        if first_given < end_given and first_known < end_known:
            _sort(pad, taken_ms)
        count = _free(pads, pad, taken_ms, unites, memory.window_s, first)
    memory.window_first[place] = first
    memory.window_count[place] = count
    memory.counts[WINDOWS] = first + count
    return first


@kernel
def _least_session_s(search: Search, row: int) -> float:
    """The least time of a recharge to the top at this station; 0 where none is known.

    A drone comes over a segment, and has used the energy for it since it was full. With packages it
    uses more. Windows that are kept for other drones are not for this drone alone.
    """
    skyway, task = search.skyway, search.task
    is_kept = search.memory.tree_of_row.size > 0
    if is_kept or row == task.start or not task.compares_masks or has_weather(skyway):
        return 0.0
    least_m = np.inf
    for index in range(skyway.in_offsets[row], skyway.in_offsets[row + 1]):
        least_m = min(least_m, skyway.in_length[index])
    without_load = (int64(1) << int64(task.destinations.size)) - 1
    used_j = least_m * task.j_per_m[without_load] - 2.0 * task.rounding_j
    top_j = task.curve_j[task.curve_j.size - 1]
    level_j = max(top_j, task.start_j) - used_j
    if level_j >= top_j:
        return 0.0
    curve = curve_at(task, row)
    return position_of(task, curve, top_j) - position_of(task, curve, level_j)


@kernel
def _gather(
    book: Book,
    first: int,
    end: int,
    pads: int,
    least_ms: int,
    offset: int,
    pad: Longs,
    taken_ms: Longs,
) -> int:
    """Write a book's reservations from `offset` on, counted from the plan's start; the end.

    Pads that the station does not have are left out: a book may be older than the network. Two
    reservations become one if less than `least_ms` lies between them.
    """
    begin = offset
    for index in range(first, end):
        if book.pad[index] >= pads:
            continue
        start_ms = book.start_ms[index] - book.zero_ms
        # An open end stays after all moments of a plan, for any zero moment of the book.
        end_ms = book.end_ms[index] - book.zero_ms
        if least_ms > 0 and offset > begin and pad[offset - 1] == book.pad[index]:
            before_ms = taken_ms[offset - 1, 1]
            if start_ms - before_ms < least_ms:
                taken_ms[offset - 1, 1] = max(before_ms, end_ms)
                continue
        pad[offset] = book.pad[index]
        taken_ms[offset, 0] = start_ms
        taken_ms[offset, 1] = end_ms
        offset += 1
    return offset


@kernel
def _sort(pad: Longs, taken_ms: Longs) -> None:
    """Sort by pad and start; the two books are sorted already, so few rows move far."""
    for index in range(1, pad.size):
        own_pad, start, end = pad[index], taken_ms[index, 0], taken_ms[index, 1]
        before = index - 1
        while before >= 0 and (
            pad[before] > own_pad or (pad[before] == own_pad and taken_ms[before, 0] > start)
        ):
            pad[before + 1] = pad[before]
            taken_ms[before + 1, 0] = taken_ms[before, 0]
            taken_ms[before + 1, 1] = taken_ms[before, 1]
            before -= 1
        pad[before + 1] = own_pad
        taken_ms[before + 1, 0] = start
        taken_ms[before + 1, 1] = end


@array_kernel
def _free(
    pads: int, pad: Longs, taken_ms: Longs, unites: bool, window_s: Floats, first: int
) -> int:
    """Write the windows of all pads, the earliest first; returns their number.

    Each pad is merged with the pads before it, which keeps the windows in order.
    """
    before = np.empty((pad.size + pads, 2))
    after = np.empty((pad.size + pads, 2))
    count = int64(0)
    used = 0
    index = 0
    while index < pad.size:
        end = index
        while end < pad.size and pad[end] == pad[index]:
            end += 1
        count = _merged(taken_ms[index:end], unites, before, count, after)
        before, after = after, before
        used += 1
        index = end
    if used < pads:
        # A pad without reservations is always free; with one such pad no other pad matters.
        window_s[first, 0] = 0.0
        window_s[first, 1] = np.inf
        return 1
    # With slices numba takes seconds longer to compile this.
    for window in range(count):
        window_s[first + window, 0] = before[window, 0]
        window_s[first + window, 1] = before[window, 1]
    return count


@kernel
def _merged(taken_ms: Longs, unites: bool, before: Floats, count: int, after: Floats) -> int:
    """Merge the windows of one pad, from its reservations, with `before`; returns their number."""
    merged = int64(0)
    other = 0
    free_from_ms = int64(0)
    index = 0
    while free_from_ms < _OPEN_MS:
        while index < taken_ms.shape[0] and taken_ms[index, 0] <= free_from_ms:
            free_from_ms = max(free_from_ms, taken_ms[index, 1])
            index += 1
        if free_from_ms >= _OPEN_MS:
            break
        start_s = free_from_ms / _MS_PER_S
        while other < count and before[other, 0] <= start_s:
            merged = _append(after, merged, before[other, 0], before[other, 1], unites)
            other += 1
        if index == taken_ms.shape[0]:
            merged = _append(after, merged, start_s, np.inf, unites)
            break
        free_from_ms = taken_ms[index, 0]
        merged = _append(after, merged, start_s, free_from_ms / _MS_PER_S, unites)
    while other < count:
        merged = _append(after, merged, before[other, 0], before[other, 1], unites)
        other += 1
    return merged


@kernel
def _append(windows: Floats, count: int, start_s: float, end_s: float, unites: bool) -> int:
    """Append a window, or lengthen the last one if they meet and may be united.

    Of two windows, one within the other, the larger stays. So starts and ends are both in order.
    """
    if count > 0:
        if end_s <= windows[count - 1, 1]:
            return count
        if start_s <= windows[count - 1, 1 if unites else 0]:
            windows[count - 1, 1] = end_s
            return count
    windows[count, 0] = start_s
    windows[count, 1] = end_s
    return count + 1
