"""When the pads of a station are free, read from the books of reservations."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from skyway.ids import StationId
from skyway.network.network import Network
from skyway.planner.pad_book import PadBook, Taken, booked_from_ms, booked_until_ms
from skyway.units import time_tolerance_s

_MS_PER_S = 1000


@dataclass(frozen=True, slots=True, order=True)
class FreeWindow:
    """A pad that is free in [start_s, end_s); both are whole milliseconds or infinite."""

    start_s: float
    pad: int
    end_s: float


@dataclass(frozen=True, slots=True)
class Session:
    """A pad and the moment from which a drone can charge there."""

    pad: int
    start_s: float


class PadCalendar:
    """The free windows of every station's pads, computed when they are first read."""

    def __init__(self, network: Network, books: Iterable[PadBook]) -> None:
        self._network = network
        self._books = tuple(books)
        self._windows: dict[StationId, tuple[FreeWindow, ...]] = {}

    def free_windows(self, station_id: StationId) -> tuple[FreeWindow, ...]:
        """The free windows of all pads of this station from time 0 on, the earliest first."""
        windows = self._windows.get(station_id)
        if windows is None:
            windows = self._windows[station_id] = tuple(sorted(self._found(station_id)))
        return windows

    def earliest_session(
        self, station_id: StationId, *, not_before_s: float, duration_s: float
    ) -> Session | None:
        """The first session of this length that fits between the reservations, or None.

        Among pads that are free equally early, the lowest number wins.
        """
        best: Session | None = None
        for window in self.free_windows(station_id):
            start_s = max(window.start_s, not_before_s)
            if best is not None and window.start_s > best.start_s:
                break
            if start_s + duration_s > window.end_s + time_tolerance_s(window.end_s) / 2:
                continue
            if best is None or (start_s, window.pad) < (best.start_s, best.pad):
                best = Session(window.pad, start_s)
        return best

    def count(self, station_id: StationId) -> int:
        """How many pads the station has."""
        return self._network.columns.pads.item(self._network.row_of[station_id])

    def taken_during(self, sessions: Sequence[tuple[StationId, int, int]]) -> list[list[Taken]]:
        """For each session the reservations at its station that overlap it.

        A session is a station, and the milliseconds from which and until which it holds a pad.
        """
        taken: list[list[Taken]] = [[] for _ in sessions]
        row_of = self._network.row_of
        rows = np.array([row_of[station_id] for station_id, _, _ in sessions], np.int32)
        from_ms = np.array([start_ms for _, start_ms, _ in sessions], np.int64)
        until_ms = np.array([end_ms for _, _, end_ms in sessions], np.int64)
        for book in self._books:
            for number, reserved in book.meeting(rows, from_ms=from_ms, until_ms=until_ms):
                taken[number].append(reserved)
        return taken

    def _taken(self, station_id: StationId) -> list[Taken]:
        row = self._network.row_of[station_id]
        return [each for book in self._books if len(book.station) for each in book.at(row)]

    def _found(self, station_id: StationId) -> Iterator[FreeWindow]:
        taken: dict[int, list[tuple[float, float]]] = {}
        for pad, start_ms, end_ms in self._taken(station_id):
            taken.setdefault(pad, []).append((start_ms, end_ms))
        for pad in range(self._network.stations[station_id].pads):
            yield from _windows_of_pad(pad, sorted(taken.get(pad, ())))


def windows_on_end(
    taken: Iterable[Taken], pads: int, *, from_s: float, until_s: float
) -> Iterator[FreeWindow]:
    """Windows in which a drone can charge without a break through this time, pad after pad.

    If several pads are free at the same moment, the pad that stays free longest is used; what lies
    beyond the time does not count. `taken` are the reservations that overlap the time.
    """
    now_ms: float = booked_from_ms(from_s)
    end_ms = booked_until_ms(until_s)
    while now_ms < end_ms:
        free_until_ms = [math.inf] * pads
        for pad, start_ms, taken_until_ms in taken:
            if pad < pads and taken_until_ms > now_ms and start_ms < free_until_ms[pad]:
                free_until_ms[pad] = start_ms
        longest_ms = max(free_until_ms, default=now_ms)
        if longest_ms <= now_ms:
            return
        pad = free_until_ms.index(longest_ms)
        yield FreeWindow(now_ms / _MS_PER_S, pad, longest_ms / _MS_PER_S)
        now_ms = longest_ms


def _windows_of_pad(pad: int, taken_ms: Iterable[tuple[float, float]]) -> Iterator[FreeWindow]:
    free_from_ms: float = 0
    for start_ms, end_ms in taken_ms:
        if start_ms > free_from_ms:
            yield FreeWindow(free_from_ms / _MS_PER_S, pad, start_ms / _MS_PER_S)
        free_from_ms = max(free_from_ms, end_ms)
    if free_from_ms < math.inf:
        yield FreeWindow(free_from_ms / _MS_PER_S, pad, math.inf)
