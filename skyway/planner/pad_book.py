"""Reservations of pads as arrays, looked up by station and never copied as a whole.

Calendars are whole milliseconds: reservations are rounded outward, so what looks free here is free
in every database that keeps whole milliseconds, and rounding never makes an overlap.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Final, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from skyway.network.network import MAX_PADS, Network
from skyway.planner.problem import PadReservation
from skyway.planner.reservations import ReservationColumns, order_of_pads
from skyway.units import TIME_TOLERANCE_S

#: End of a reservation that has none, milliseconds.
OPEN_MS: Final = 1 << 62

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


class Taken(NamedTuple):
    """A pad that is reserved, in milliseconds from the book's zero moment; an open end is inf."""

    pad: int
    start_ms: float
    end_ms: float


@dataclass(frozen=True, slots=True, eq=False)
class PadBook:
    """Which pad is reserved from when to when; ``(n_reservations,)`` each, sorted.

    `station` are rows of the network, int32; `pad` int32; `start_ms` and `end_ms` int64 on a scale
    of the book's own, on which `zero_ms` is the moment that a reader counts from. The order is
    by station, then pad, then start.
    """

    station: npt.NDArray[np.int32]
    pad: npt.NDArray[np.int32]
    start_ms: npt.NDArray[np.int64]
    end_ms: npt.NDArray[np.int64]
    zero_ms: int = 0

    @classmethod
    def of(cls, network: Network, reservations: Iterable[PadReservation]) -> Self:
        """The book of these reservations; moments count from the plan's start."""
        columns = ReservationColumns.of(reservations)
        is_open = columns.end_s == math.inf
        ends_s = np.where(is_open, 0.0, columns.end_s)
        return cls.of_arrays(
            station=columns.rows(network),
            pad=columns.pad,
            start_ms=np.floor(columns.start_s * _MS_PER_S + _MS_TOLERANCE).astype(np.int64),
            end_ms=np.where(
                is_open, OPEN_MS, np.ceil(ends_s * _MS_PER_S - _MS_TOLERANCE).astype(np.int64)
            ),
        )

    @classmethod
    def of_arrays(
        cls,
        *,
        station: npt.NDArray[np.integer],
        pad: npt.NDArray[np.integer],
        start_ms: npt.NDArray[np.integer],
        end_ms: npt.NDArray[np.integer],
    ) -> Self:
        """The book of these columns, in any order; `OPEN_MS` means without end."""
        order = order_of_pads(station.astype(np.int64) * MAX_PADS + pad, start_ms)
        return cls(
            np.ascontiguousarray(station[order], np.int32),
            np.ascontiguousarray(pad[order], np.int32),
            np.ascontiguousarray(start_ms[order], np.int64),
            np.ascontiguousarray(end_ms[order], np.int64),
        )

    def seen_from(self, moment_ms: int) -> Self:
        """The same book with this moment of its scale as time 0."""
        return replace(self, zero_ms=moment_ms)

    def without(self, sessions: npt.NDArray[np.int64]) -> Self:
        """The same book without these sessions ``(k, 4)``, in milliseconds from its zero moment."""
        held = {(row, pad, start, end) for row, pad, start, end in sessions.tolist()}
        keeps = [
            (row, pad, start - self.zero_ms, end - self.zero_ms) not in held
            for row, pad, start, end in zip(
                self.station.tolist(),
                self.pad.tolist(),
                self.start_ms.tolist(),
                self.end_ms.tolist(),
                strict=True,
            )
        ]
        return replace(
            self,
            station=self.station[keeps],
            pad=self.pad[keeps],
            start_ms=self.start_ms[keeps],
            end_ms=self.end_ms[keeps],
        )

    def at(self, station_row: int) -> list[Taken]:
        """The reservations of a station, by pad and start."""
        found = self.rows_at(station_row)
        return self._taken(np.arange(found.start, found.stop))

    def meeting(
        self,
        station_row: npt.NDArray[np.int32],
        *,
        from_ms: npt.NDArray[np.int64],
        until_ms: npt.NDArray[np.int64],
    ) -> Iterator[tuple[int, Taken]]:
        """The reservations that overlap many spans of time ``(n,)``, each at a station.

        Each item is the number of a span and a reservation that overlaps it. They are sorted by
        span, pad and start.
        """
        if not len(self.station):
            return iter(())
        first = self.station.searchsorted(station_row)
        count = self.station.searchsorted(station_row, "right") - first
        number = np.repeat(np.arange(len(count)), count)
        row = np.arange(len(number)) + (first - np.cumsum(count) + count)[number]
        begins = self.start_ms[row] < (until_ms + self.zero_ms)[number]
        number, row = number[begins], row[begins]
        meets = self.end_ms[row] > (from_ms + self.zero_ms)[number]
        return zip(number[meets].tolist(), self._taken(row[meets]), strict=True)

    def _taken(self, rows: npt.NDArray[np.int64]) -> list[Taken]:
        return [
            Taken(
                pad,
                start_ms - self.zero_ms,
                math.inf if end_ms >= OPEN_MS else end_ms - self.zero_ms,
            )
            for pad, start_ms, end_ms in zip(
                self.pad[rows].tolist(),
                self.start_ms[rows].tolist(),
                self.end_ms[rows].tolist(),
                strict=True,
            )
        ]

    def rows_at(self, station_row: int) -> slice:
        """The rows of this station."""
        if not len(self.station):
            return slice(0, 0)
        # With another type than the column's, numpy would convert the whole column.
        rows = np.array((station_row, station_row + 1), np.int32)
        first, end = self.station.searchsorted(rows).tolist()
        return slice(first, end)


#: No pad is reserved.
NO_RESERVATIONS: Final = PadBook(
    np.empty(0, np.int32), np.empty(0, np.int32), np.empty(0, np.int64), np.empty(0, np.int64)
)
