"""When the pads of a station are free, read from the books of who holds them."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from skyway.ids import StationId
from skyway.network.network import Network
from skyway.planner.pad_book import PadBook
from skyway.units import TIME_TOLERANCE_S

_MS_PER_S = 1000


@dataclass(frozen=True, slots=True, order=True)
class FreeWindow:
    """A pad that nobody else holds in [start_s, end_s); both are whole milliseconds or infinite."""

    start_s: float
    pad: int
    end_s: float


@dataclass(frozen=True, slots=True)
class Session:
    """A pad and the moment from which a drone can charge there."""

    pad: int
    start_s: float


class PadCalendar:
    """The free windows of every station's pads, worked out when first asked for."""

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

        Among pads that are free equally early the lowest number is taken.
        """
        best: Session | None = None
        for window in self.free_windows(station_id):
            start_s = max(window.start_s, not_before_s)
            if best is not None and window.start_s > best.start_s:
                break
            if start_s + duration_s > window.end_s:
                continue
            if best is None or (start_s, window.pad) < (best.start_s, best.pad):
                best = Session(window.pad, start_s)
        return best

    def windows_on_end(self, station_id: StationId, *, from_s: float) -> Iterator[FreeWindow]:
        """The windows in which a drone can charge without a break from this moment, pad after pad.

        Each begins before the one before it ends; of several the one that lasts longest is taken.
        """
        now_s = from_s
        while True:
            open_now = [
                window
                for window in self.free_windows(station_id)
                if window.start_s <= now_s + TIME_TOLERANCE_S < window.end_s
            ]
            if not open_now:
                return
            longest = max(open_now, key=lambda window: (window.end_s, -window.pad))
            yield longest
            now_s = longest.end_s

    def _found(self, station_id: StationId) -> Iterator[FreeWindow]:
        row = self._network.row_of[station_id]
        taken: dict[int, list[tuple[float, float]]] = {}
        for book in self._books:
            for pad, start_ms, end_ms in book.at(row):
                taken.setdefault(pad, []).append((start_ms, end_ms))
        for pad in range(self._network.stations[station_id].pads):
            yield from _windows_of_pad(pad, sorted(taken.get(pad, ())))


def _windows_of_pad(pad: int, taken_ms: Iterable[tuple[float, float]]) -> Iterator[FreeWindow]:
    free_from_ms: float = 0
    for start_ms, end_ms in taken_ms:
        if start_ms > free_from_ms:
            yield FreeWindow(free_from_ms / _MS_PER_S, pad, start_ms / _MS_PER_S)
        free_from_ms = max(free_from_ms, end_ms)
    if free_from_ms < math.inf:
        yield FreeWindow(free_from_ms / _MS_PER_S, pad, math.inf)
