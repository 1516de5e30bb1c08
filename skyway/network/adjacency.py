"""Which segments leave each station, or reach it, as arrays."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from skyway.network.columns import Floats, Rows


@dataclass(frozen=True, slots=True, eq=False)
class Adjacency:
    """The segments at each station, those of one station in the order of the document.

    Entries ``offsets[row]`` up to ``offsets[row + 1]`` belong to the station of that row.

    Parameters
    ----------
    offsets
        ``(n + 1,)`` int64.
    station
        ``(m,)`` int32, the row of the station at the other end.
    segment
        ``(m,)`` int32, the segment's row.
    length_m
        ``(m,)`` float64.
    """

    offsets: npt.NDArray[np.int64]
    station: Rows
    segment: Rows
    length_m: Floats

    @classmethod
    def of(cls, near_row: Rows, far_row: Rows, *, length_m: Floats, stations: int) -> "Adjacency":
        """The adjacency of segments that are found at their near end."""
        segment = np.argsort(near_row, kind="stable").astype(np.int32)
        offsets = np.zeros(stations + 1, np.int64)
        np.cumsum(np.bincount(near_row, minlength=stations), out=offsets[1:])
        return cls(offsets, far_row[segment], segment, length_m[segment])

    def at(self, row: int) -> slice:
        """Where the entries of this station stand."""
        return slice(int(self.offsets[row]), int(self.offsets[row + 1]))

    def degrees(self) -> npt.NDArray[np.int64]:
        """How many segments each station has, ``(n,)``."""
        return np.diff(self.offsets)
