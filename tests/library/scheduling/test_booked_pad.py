from skyway.ids import StationId
from skyway.scheduling.booked_pad import BookedPad, merged


def held(station: str, pad: int, start_ms: int, end_ms: int) -> BookedPad:
    return BookedPad(StationId(station), pad, start_ms, end_ms)


def test_sessions_that_touch_on_one_pad_are_one_reservation() -> None:
    sessions = [held("a", 0, 10, 20), held("a", 0, 0, 10), held("a", 0, 19, 30)]

    assert merged(sessions) == (held("a", 0, 0, 30),)


def test_sessions_with_a_gap_or_on_different_pads_stay_separate() -> None:
    sessions = [
        held("b", 0, 0, 10),
        held("a", 1, 10, 20),
        held("a", 0, 0, 10),
        held("a", 0, 11, 12),
    ]

    assert merged(sessions) == tuple(sorted(sessions))


def test_a_session_within_another_adds_nothing() -> None:
    assert merged([held("a", 0, 0, 30), held("a", 0, 5, 10)]) == (held("a", 0, 0, 30),)
