"""Holds and releases pads between two searches, in a pad book that can be changed.

The arrays of the book have room for more reservations. Unused rows come last, with a station row
after all others, so that a search reads this book like any other book.
"""

import numpy as np

from skyway.planner.kernels.compiler import entrance, kernel
from skyway.planner.kernels.memory import NONE, STALE, Longs, Memory, int64
from skyway.planner.kernels.pads import end_of, first_of
from skyway.planner.kernels.places import slot_of
from skyway.planner.kernels.records import Book

# The station row of unused rows, after all rows of a network.
UNUSED = np.iinfo(np.int32).max

# Why sessions were not held or released.
NO_ROOM = -2


@entrance
def hold(known: Book, held: Book, used: int, sessions: Longs, memory: Memory) -> int:
    """Enter these sessions ``(k, 4)``: station row, pad, start and end in milliseconds.

    Returns -1, or the number of the first session whose pad is already held; then none is
    entered. `used` is the number of rows in use before.
    """
    if used + sessions.shape[0] > held.station.size:
        return NO_ROOM
    for number in range(sessions.shape[0]):
        row = sessions[number]
        if _is_held(known, row) or _is_held(held, row):
            for before in range(number):
                _remove(held, used + number - before, sessions[number - 1 - before])
            return number
        _insert(held, used + number, row)
    for number in range(sessions.shape[0]):
        _forget_windows(memory, sessions[number, 0])
    return NONE


@entrance
def release(held: Book, used: int, sessions: Longs, memory: Memory) -> int:
    """Remove these sessions; returns -1, or the number of the first session that is not held."""
    for number in range(sessions.shape[0]):
        if _place_in(held, used - number, sessions[number]) < 0:
            for before in range(number):
                _insert(held, used - number + before, sessions[number - 1 - before])
            return number
        _remove(held, used - number, sessions[number])
    for number in range(sessions.shape[0]):
        _forget_windows(memory, sessions[number, 0])
    return NONE


@kernel
def _is_held(book: Book, session: Longs) -> bool:
    """Whether a reservation of this book overlaps the session."""
    first = first_of(book, session[0])
    for index in range(first, end_of(book, session[0], first)):
        if (
            book.pad[index] == session[1]
            and book.start_ms[index] - book.zero_ms < session[3]
            and book.end_ms[index] - book.zero_ms > session[2]
        ):
            return True
    return False


@kernel
def _insert(book: Book, used: int, session: Longs) -> None:
    """Enter a session at its place in the order by station, pad and start."""
    index = int64(used)
    while index > 0 and _is_after(book, index - 1, session):
        book.station[index] = book.station[index - 1]
        book.pad[index] = book.pad[index - 1]
        book.start_ms[index] = book.start_ms[index - 1]
        book.end_ms[index] = book.end_ms[index - 1]
        index -= 1
    book.station[index] = session[0]
    book.pad[index] = session[1]
    book.start_ms[index] = session[2] + book.zero_ms
    book.end_ms[index] = session[3] + book.zero_ms


@kernel
def _is_after(book: Book, index: int, session: Longs) -> bool:
    if book.station[index] != session[0]:
        return book.station[index] > session[0]
    if book.pad[index] != session[1]:
        return book.pad[index] > session[1]
    return book.start_ms[index] - book.zero_ms > session[2]


@kernel
def _remove(book: Book, used: int, session: Longs) -> None:
    """Remove a session that is in the book."""
    for index in range(_place_in(book, used, session), used - 1):
        book.station[index] = book.station[index + 1]
        book.pad[index] = book.pad[index + 1]
        book.start_ms[index] = book.start_ms[index + 1]
        book.end_ms[index] = book.end_ms[index + 1]
    book.station[used - 1] = UNUSED


@kernel
def _place_in(book: Book, used: int, session: Longs) -> int:
    """The index of exactly this session; -1 if it is not in the book."""
    index = first_of(book, session[0])
    while index < used and book.station[index] == session[0]:
        if (
            book.pad[index] == session[1]
            and book.start_ms[index] - book.zero_ms == session[2]
            and book.end_ms[index] - book.zero_ms == session[3]
        ):
            return index
        index += 1
    return NONE


@kernel
def _forget_windows(memory: Memory, row: int) -> None:
    """Mark the free windows of this station, so that they are computed again."""
    slot = slot_of(row, memory.table.size)
    while memory.table[slot] != 0:
        place = memory.table[slot] - 1
        if memory.row[place] == row:
            if memory.window_first[place] >= 0:
                memory.counts[STALE] += memory.window_count[place]
                memory.window_first[place] = NONE
            return
        slot = (slot + 1) & (memory.table.size - 1)
