"""When the pads of a station are free.

Calendars are whole milliseconds: reservations and sessions are rounded outward, so what looks free
here is free in every database that keeps whole milliseconds, and rounding never makes an overlap.
"""

import math
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass

from skyway.ids import StationId
from skyway.network.network import Network
from skyway.planner.problem import PadReservation
from skyway.units import TIME_TOLERANCE_S

_MS_PER_S = 1000
#: A moment this close to a whole millisecond, in milliseconds, is that millisecond: 1.001 s times
#: 1000 is 1000.9999999999999 in floats.
_MS_TOLERANCE = TIME_TOLERANCE_S * _MS_PER_S


def booked_from_ms(start_s: float) -> int:
    """The whole millisecond from which a session or reservation starting now holds its pad."""
    return math.floor(start_s * _MS_PER_S + _MS_TOLERANCE)


def booked_until_ms(end_s: float) -> int:
    """The whole millisecond until which a session or reservation ending now holds its pad."""
    return math.ceil(end_s * _MS_PER_S - _MS_TOLERANCE)


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

    def __init__(self, network: Network, reservations: Iterable[PadReservation]) -> None:
        self._network = network
        self._reserved: dict[StationId, list[PadReservation]] = defaultdict(list)
        for reservation in reservations:
            self._reserved[reservation.station_id].append(reservation)
        self._windows: dict[StationId, tuple[FreeWindow, ...]] = {}

    def free_windows(self, station_id: StationId) -> tuple[FreeWindow, ...]:
        """The free windows of all pads of this station from time 0 on, the earliest first."""
        windows = self._windows.get(station_id)
        if windows is None:
            windows = self._windows[station_id] = tuple(
                sorted(
                    window
                    for pad in range(self._network.stations[station_id].pads)
                    for window in self._windows_of_pad(station_id, pad)
                )
            )
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

    def _windows_of_pad(self, station_id: StationId, pad: int) -> Iterable[FreeWindow]:
        taken_ms = sorted(
            (
                booked_from_ms(reservation.start_s),
                math.inf if reservation.end_s is None else booked_until_ms(reservation.end_s),
            )
            for reservation in self._reserved[station_id]
            if reservation.pad == pad
        )
        free_from_ms: float = 0
        for start_ms, end_ms in taken_ms:
            if start_ms > free_from_ms:
                yield FreeWindow(free_from_ms / _MS_PER_S, pad, start_ms / _MS_PER_S)
            free_from_ms = max(free_from_ms, end_ms)
        if free_from_ms < math.inf:
            yield FreeWindow(free_from_ms / _MS_PER_S, pad, math.inf)
