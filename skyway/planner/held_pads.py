"""The pads that others hold, at the stations where a verified plan charges.

Written for `verify` alone: it looks up single sessions, where the search keeps free windows.
"""

import math
from collections import defaultdict
from collections.abc import Set
from typing import TYPE_CHECKING

from skyway.delivery.plan import Recharge
from skyway.ids import StationId
from skyway.planner.problem import Problem
from skyway.units import TIME_TOLERANCE_S

if TYPE_CHECKING:
    from skyway.planner.pad_book import PadBook

_MS_PER_S = 1000
_MS_TOLERANCE = TIME_TOLERANCE_S * _MS_PER_S


class HeldPads:
    """The reservations of these stations: the problem's own, and the booked ones."""

    def __init__(
        self, problem: Problem, stations: Set[StationId], *, booked: "PadBook | None"
    ) -> None:
        self._held_ms: dict[tuple[StationId, int], list[tuple[float, float]]] = defaultdict(list)
        for reservation in problem.pad_reservations:
            if reservation.station_id in stations:
                end_s = math.inf if reservation.end_s is None else reservation.end_s
                self._held_ms[reservation.station_id, reservation.pad].append(
                    _outward_ms(reservation.start_s, end_s)
                )
        self._row_of = problem.network.row_of
        self._booked = booked

    def clash(self, session: Recharge) -> tuple[float, float] | None:
        """The milliseconds of a reservation that this session overlaps, or None."""
        start_ms, end_ms = _outward_ms(session.start_s, session.end_s)
        for other_start_ms, other_end_ms in self._held_ms.get(
            (session.station_id, session.pad), ()
        ):
            if start_ms < other_end_ms and other_start_ms < end_ms:
                return other_start_ms, other_end_ms
        row = self._row_of.get(session.station_id)
        if self._booked is None or row is None:
            return None
        for pad, other_start_ms, other_end_ms in self._booked.at(
            row, from_ms=start_ms, until_ms=end_ms
        ):
            if pad == session.pad:
                return other_start_ms, other_end_ms
        return None


def _outward_ms(start_s: float, end_s: float) -> tuple[float, float]:
    """The span of whole milliseconds around this time, despite rounding of floats."""
    start_ms, end_ms = start_s * _MS_PER_S, end_s * _MS_PER_S
    return (
        math.floor(start_ms + _MS_TOLERANCE + math.ulp(start_ms)),
        end_ms if end_ms == math.inf else math.ceil(end_ms - _MS_TOLERANCE - math.ulp(end_ms)),
    )
