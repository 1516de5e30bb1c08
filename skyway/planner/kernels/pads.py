"""The free windows of a station's pads, worked out when the search first stands there.

Under partial recharging a drone may change pads, so what counts is when any pad is free: the union
of the pads' windows. A full recharge needs one pad for all of it, so the windows stay apart.
"""

import numpy as np

from skyway.planner.kernels.compiler import kernel
from skyway.planner.kernels.memory import FULL, WINDOWS, Book, Memory, Skyway, Task

_MS_PER_S = 1000.0


@kernel
def first_of(book: Book, row: int) -> int:
    """The index of this station's first reservation, or of whatever follows."""
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


@kernel
def windows_of(
    skyway: Skyway, task: Task, given: Book, known: Book, memory: Memory, place: int
) -> int:
    """The first of this place's free windows; -1 when the memory is full."""
    if memory.window_first[place] >= 0:
        return memory.window_first[place]
    row = memory.row[place]
    pads = skyway.pads[row]
    first_given, first_known = first_of(given, row), first_of(known, row)
    end_given, end_known = end_of(given, row, first_given), end_of(known, row, first_known)
    reserved = end_given - first_given + end_known - first_known
    first = memory.count[WINDOWS]
    if first + reserved + pads > memory.window_s.shape[0]:
        memory.count[FULL] = 1
        return -1
    if pads == 0:
        count = 0
    elif reserved == 0:
        memory.window_s[first, 0] = 0.0
        memory.window_s[first, 1] = np.inf
        count = 1
    else:
        pad = np.empty(reserved, np.int32)
        taken = np.empty((reserved, 2), np.int64)
        _gather(given, first_given, end_given, 0, pad, taken)
        _gather(known, first_known, end_known, end_given - first_given, pad, taken)
        if first_given < end_given and first_known < end_known:
            _sort(pad, taken)
        count = _free(pads, pad, taken, memory.window_s, first)
        if not task.recharges_fully:
            count = _united(memory.window_s, first, count)
    memory.window_first[place] = first
    memory.window_count[place] = count
    memory.count[WINDOWS] = first + count
    return first


@kernel
def _gather(book, first, end, offset, pad, taken):
    for index in range(first, end):
        pad[offset + index - first] = book.pad[index]
        taken[offset + index - first, 0] = book.start_ms[index] - book.zero_ms
        # An open end stays beyond all moments of a plan, whatever the book's zero.
        taken[offset + index - first, 1] = book.end_ms[index] - book.zero_ms


@kernel
def _sort(pad, taken):
    """By pad and start; the two books are sorted already, so little moves far."""
    for index in range(1, pad.size):
        own_pad, start, end = pad[index], taken[index, 0], taken[index, 1]
        before = index - 1
        while before >= 0 and (
            pad[before] > own_pad or (pad[before] == own_pad and taken[before, 0] > start)
        ):
            pad[before + 1] = pad[before]
            taken[before + 1, 0] = taken[before, 0]
            taken[before + 1, 1] = taken[before, 1]
            before -= 1
        pad[before + 1] = own_pad
        taken[before + 1, 0] = start
        taken[before + 1, 1] = end


@kernel
def _free(pads, pad, taken, window_s, first):
    """Write the windows of all pads, the earliest first; how many they are."""
    count = 0
    index = 0
    used = 0
    while index < pad.size:
        own_pad = pad[index]
        used += 1
        free_from = 0
        while index < pad.size and pad[index] == own_pad:
            if taken[index, 0] > free_from:
                count = _entered(window_s, first, count, free_from, taken[index, 0])
            free_from = max(free_from, taken[index, 1])
            index += 1
        if free_from < _OPEN_MS:
            count = _entered(window_s, first, count, free_from, _NEVER_MS)
    if used < pads:
        # A pad that nobody has reserved is free all the time; one such pad is enough to know.
        window_s[first, 0] = 0.0
        window_s[first, 1] = np.inf
        return 1
    return count


# A reservation that ends later than this has no end: the books' open end less any zero moment.
_OPEN_MS = 1 << 61
_NEVER_MS = 1 << 62


@kernel
def _entered(window_s, first, count, from_ms, until_ms):
    """Enter one window among those sorted by start; how many there are then."""
    start_s = from_ms / _MS_PER_S
    place = first + count
    while place > first and window_s[place - 1, 0] > start_s:
        window_s[place, 0] = window_s[place - 1, 0]
        window_s[place, 1] = window_s[place - 1, 1]
        place -= 1
    window_s[place, 0] = start_s
    window_s[place, 1] = np.inf if until_ms == _NEVER_MS else until_ms / _MS_PER_S
    return count + 1


@kernel
def _united(window_s, first, count):
    """Unite windows that meet; how many are left."""
    last = first
    for index in range(first + 1, first + count):
        if window_s[index, 0] <= window_s[last, 1]:
            window_s[last, 1] = max(window_s[last, 1], window_s[index, 1])
        else:
            last += 1
            window_s[last, 0] = window_s[index, 0]
            window_s[last, 1] = window_s[index, 1]
    return last - first + 1 if count > 0 else 0
