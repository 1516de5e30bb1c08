"""A reserved pad, in whole milliseconds."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from skyway.ids import StationId


@dataclass(frozen=True, slots=True, order=True)
class BookedPad:
    """One pad of one station, reserved in [start_ms, end_ms) of fleet time."""

    station_id: StationId
    pad: int
    start_ms: int
    end_ms: int


def without(sessions: Iterable[BookedPad], others: Iterable[BookedPad]) -> tuple[BookedPad, ...]:
    """What is left of these sessions when others use the same pads for some of the time."""
    left = [*sessions]
    for other in others:
        left = [part for session in left for part in _parts_beside(session, other)]
    return tuple(left)


def _parts_beside(session: BookedPad, other: BookedPad) -> Iterator[BookedPad]:
    """The parts of a session before and after another one of the same pad."""
    is_same_pad = (session.station_id, session.pad) == (other.station_id, other.pad)
    if not is_same_pad or other.end_ms <= session.start_ms or session.end_ms <= other.start_ms:
        yield session
        return
    if session.start_ms < other.start_ms:
        yield replace(session, end_ms=other.start_ms)
    if other.end_ms < session.end_ms:
        yield replace(session, start_ms=other.end_ms)


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
