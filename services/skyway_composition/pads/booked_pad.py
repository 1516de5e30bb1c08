"""A reserved pad, in whole milliseconds."""

from collections.abc import Iterable
from dataclasses import dataclass

from skyway.ids import StationId


@dataclass(frozen=True, slots=True, order=True)
class BookedPad:
    """One pad of one station, reserved in [start_ms, end_ms) of fleet time."""

    station_id: StationId
    pad: int
    start_ms: int
    end_ms: int


def merged(sessions: Iterable[BookedPad]) -> tuple[BookedPad, ...]:
    """One mission's sessions, sorted; sessions that touch on one pad become one session.

    The order is the same in every booking. Otherwise two bookings could lock each other's rows
    crosswise and wait for each other.
    """
    held: list[BookedPad] = []
    for session in sorted(sessions):
        last = held[-1] if held else None
        if (
            last is not None
            and (last.station_id, last.pad) == (session.station_id, session.pad)
            and session.start_ms <= last.end_ms
        ):
            end_ms = max(last.end_ms, session.end_ms)
            held[-1] = BookedPad(last.station_id, last.pad, last.start_ms, end_ms)
        else:
            held.append(session)
    return tuple(held)
