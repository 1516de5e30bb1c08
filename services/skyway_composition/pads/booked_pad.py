"""A pad held for a while: the whole milliseconds that a reservation covers."""

from collections.abc import Iterable
from dataclasses import dataclass

from skyway.ids import StationId


@dataclass(frozen=True, slots=True, order=True)
class BookedPad:
    """One pad of one station, held in [start_ms, end_ms) of fleet time."""

    station_id: StationId
    pad: int
    start_ms: int
    end_ms: int


def merged(sessions: Iterable[BookedPad]) -> tuple[BookedPad, ...]:
    """One mission's sessions with those that touch on one pad made one, in sorted order.

    Sorted, because every booking then asks for its rows in the same order: two bookings that
    lock each other's rows crosswise would wait for each other.
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
