"""The reserved pads, which a caller changes between two calls of `compose_many`."""

from collections.abc import Iterable

import numpy as np

from skyway.errors import SkywayError
from skyway.planner.exact_memory import MOST_TREES, Room, enlarged, new_memory
from skyway.planner.exact_task import book_handle, book_of
from skyway.planner.kernels import held_pads
from skyway.planner.kernels.handles import handle_of
from skyway.planner.kernels.memory import TREES, Longs
from skyway.planner.kernels.records import Book
from skyway.planner.pad_book import NO_RESERVATIONS, PadBook
from skyway.planner.trip_terms import TripTerms

#: The most bytes of the trees of destinations; then all trees are dropped. Our own choice.
_MOST_TREE_BYTES = 1 << 28
#: Bytes of a tree for each place: a distance and the three columns of its heap.
_BYTES_PER_PLACE = 32
#: The first sizes. There are few places, so that the trees of many destinations fit.
_ROOM = Room(places=1 << 12)


class PadIsTaken(SkywayError):
    """A session to reserve overlaps a reservation, or a session to release is not reserved."""

    def __init__(self, session: Longs, detail: str) -> None:
        row, pad, from_ms, until_ms = session.tolist()
        super().__init__(f"station row {row}, pad {pad}, {from_ms} to {until_ms} ms: {detail}")
        self.session = session


class PadLedger:
    """The reservations of pads, and the memory of the searches.

    A change of a station's reservations costs some microseconds, because only that station's free
    windows are computed again. A ledger is for one thread: each thread needs a ledger of its own.

    Parameters
    ----------
    terms
        What the trips have in common.
    booked
        The reservations at the beginning. Its `zero_ms` is the zero of all trips.
    """

    def __init__(self, terms: TripTerms, booked: PadBook = NO_RESERVATIONS) -> None:
        self.terms = terms
        self._booked = booked
        self._used = 0
        self._set_held(_empty(1 << 6, booked.zero_ms))
        self.known = book_handle(booked)
        self.memory = new_memory(MOST_TREES, room=_ROOM)._replace(
            tree_of_row=np.full(len(terms.network.columns.station_ids), -1, np.int64)
        )
        self._drop_trees()
        self.notes = handle_of(self.memory)

    def reserve(self, sessions: Longs) -> None:
        """Reserve these sessions ``(k, 4)``: station row, pad, start and end in milliseconds.

        Raises
        ------
        PadIsTaken
            One of the pads is reserved at that time. Then none of the sessions is reserved.
        """
        while True:
            ended = held_pads.hold(self.known, self.held, self._used, sessions, self.notes)
            if ended != held_pads.NO_ROOM:
                break
            self._set_held(_with_room(self._held, 2 * (self._used + len(sessions))))
        if ended >= 0:
            raise PadIsTaken(sessions[ended], "the session overlaps a reservation")
        self._used += len(sessions)

    def release(self, sessions: Longs) -> None:
        """Release sessions that were reserved.

        Raises
        ------
        PadIsTaken
            One of them is not reserved. Then none of the sessions is released.
        """
        ended = held_pads.release(self.held, self._used, sessions, self.notes)
        if ended >= 0:
            raise PadIsTaken(sessions[ended], "the session is not reserved")
        self._used -= len(sessions)

    def book(self, rows: Iterable[int] | None = None) -> PadBook:
        """All current reservations; with `rows`, only the reservations at these station rows."""
        columns, used = self._held, self._used
        held = PadBook(
            columns.station[:used],
            columns.pad[:used],
            columns.start_ms[:used],
            columns.end_ms[:used],
            columns.zero_ms,
        )
        books = (self._booked, held)
        if rows is None:
            parts = [(slice(None), book) for book in books]
        else:
            parts = [(book.rows_at(row), book) for book in books for row in sorted(set(rows))]
        chosen = {
            name: np.concatenate([getattr(book, name)[part] for part, book in parts] or [[]])
            for name in ("station", "pad", "start_ms", "end_ms")
        }
        return PadBook.of_arrays(**chosen).seen_from(self._booked.zero_ms)

    def enlarge_memory(self) -> None:
        """Give the search more room."""
        self.memory = enlarged(self.memory)
        self.notes = handle_of(self.memory)

    def enlarge_trees(self) -> None:
        """Make room for the trees of other destinations."""
        trees = 2 * self.memory.radius.size
        if trees * len(self.memory.row) * _BYTES_PER_PLACE <= _MOST_TREE_BYTES:
            self.memory = enlarged(self.memory, trees=trees)
        else:
            self._drop_trees()
        self.notes = handle_of(self.memory)

    def _drop_trees(self) -> None:
        self.memory.tree_of_row[:] = -1
        self.memory.counts[TREES] = 0

    def _set_held(self, held: Book) -> None:
        self._held = held
        self.held = handle_of(held)


def _empty(room: int, zero_ms: int) -> Book:
    return book_of(
        PadBook(
            np.full(room, held_pads.UNUSED, np.int32),
            np.zeros(room, np.int32),
            np.zeros(room, np.int64),
            np.zeros(room, np.int64),
            zero_ms,
        )
    )


def _with_room(book: Book, room: int) -> Book:
    larger, count = _empty(room, book.zero_ms), len(book.station)
    larger.station[:count] = book.station
    larger.pad[:count] = book.pad
    larger.start_ms[:count] = book.start_ms
    larger.end_ms[:count] = book.end_ms
    return larger
