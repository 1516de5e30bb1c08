import math

import numpy as np
import pytest

from skyway.planner.pad_book import PadBook, booked_from_ms, booked_until_ms
from skyway.planner.pad_calendar import FreeWindow, PadCalendar, Session, windows_on_end
from skyway.planner.problem import PadReservation


@pytest.fixture
def calendar_of(make_network):
    def make(*reservations, pads=1):
        network = make_network("a-b:1", pads={"b": pads})
        reserved = (
            PadReservation(station_id="b", pad=pad, start_s=start_s, end_s=end_s)
            for pad, start_s, end_s in reservations
        )
        return PadCalendar(network, [PadBook.of(network, reserved)])

    return make


def test_a_pad_without_reservations_is_always_free(calendar_of):
    assert calendar_of().free_windows("b") == (FreeWindow(0.0, 0, math.inf),)


def test_a_station_without_pads_has_no_windows(calendar_of):
    assert calendar_of(pads=0).free_windows("b") == ()


def test_windows_lie_between_reservations_that_may_overlap(calendar_of):
    calendar = calendar_of((0, 50.0, 60.0), (0, 10.0, 20.0), (0, 15.0, 30.0), (0, -5.0, 2.0))

    windows = [(window.start_s, window.end_s) for window in calendar.free_windows("b")]

    assert windows == [(2.0, 10.0), (30.0, 50.0), (60.0, math.inf)]


def test_an_open_reservation_takes_the_pad_for_good(calendar_of):
    assert calendar_of((0, 0.0, None)).free_windows("b") == ()


def test_windows_shrink_inward_to_whole_milliseconds(calendar_of):
    calendar = calendar_of((0, 1.0004, 2.0001))

    windows = [(window.start_s, window.end_s) for window in calendar.free_windows("b")]

    assert windows == [(0.0, 1.0), (2.001, math.inf)]


@pytest.mark.parametrize("milliseconds", [1, 1001, 1009, 4_005, 1_234_567_891])
def test_a_whole_millisecond_is_kept_although_floats_round_it(milliseconds: int):
    assert booked_from_ms(milliseconds / 1000) == milliseconds
    assert booked_until_ms(milliseconds / 1000) == milliseconds


def test_sessions_are_booked_outward():
    assert (booked_from_ms(1.0009), booked_until_ms(1.0011)) == (1000, 1002)


def test_a_session_may_touch_both_its_neighbours(calendar_of):
    calendar = calendar_of((0, 0.0, 10.0), (0, 20.0, 30.0))

    session = calendar.earliest_session("b", not_before_s=0.0, duration_s=10.0)

    assert session == Session(pad=0, start_s=10.0)


def test_a_session_one_millisecond_too_long_waits_for_the_next_window(calendar_of):
    calendar = calendar_of((0, 0.0, 10.0), (0, 20.0, 30.0))

    session = calendar.earliest_session("b", not_before_s=0.0, duration_s=10.001)

    assert session == Session(pad=0, start_s=30.0)


def test_the_pad_that_is_free_first_is_taken(calendar_of):
    calendar = calendar_of((0, 0.0, 40.0), (1, 0.0, 30.0), (2, 5.0, 35.0), pads=3)

    session = calendar.earliest_session("b", not_before_s=1.0, duration_s=10.0)

    assert session == Session(pad=1, start_s=30.0)


def test_among_pads_that_are_free_immediately_the_lowest_number_wins(calendar_of):
    calendar = calendar_of((0, 0.0, 40.0), (1, 0.0, 6.0), pads=3)

    session = calendar.earliest_session("b", not_before_s=10.0, duration_s=10.0)

    assert session == Session(pad=1, start_s=10.0)


def test_without_a_window_long_enough_there_is_no_session(calendar_of):
    calendar = calendar_of((0, 50.0, None))

    assert calendar.earliest_session("b", not_before_s=0.0, duration_s=51.0) is None


def test_a_session_is_split_onto_the_pads_that_stay_free_longest(calendar_of):
    calendar = calendar_of((0, 10.0, 40.0), (1, 0.0, 5.0), (1, 25.0, None), pads=2)
    sessions = [("b", 0.0, 50.0), ("b", 5.0, 20.0), ("b", 41.0, 60.0), ("a", 0.0, 9.0)]

    taken = calendar.taken_during(
        [(station_id, int(1000 * a), int(1000 * b)) for station_id, a, b in sessions]
    )

    windows = [
        [(one.pad, one.start_s, one.end_s) for one in windows_on_end(each, 2, from_s=a, until_s=b)]
        for each, (_, a, b) in zip(taken, sessions, strict=True)
    ]
    assert windows == [
        [(0, 0.0, 10.0), (1, 10.0, 25.0)],
        [(1, 5.0, math.inf)],
        [(0, 41.0, math.inf)],
        [(0, 0.0, math.inf)],
    ]


@pytest.mark.parametrize("seed", range(20))
def test_reservations_of_many_sessions_are_those_of_each_session(seed: int):
    random = np.random.default_rng(seed)
    start_ms = random.integers(-50, 50, 30)
    book = PadBook.of_arrays(
        station=random.integers(0, 5, 30),
        pad=random.integers(0, 3, 30),
        start_ms=start_ms,
        end_ms=start_ms + random.integers(1, 20, 30),
    ).seen_from(7)
    rows = random.integers(0, 6, 12).astype(np.int32)
    from_ms = random.integers(-50, 50, 12)
    until_ms = from_ms + random.integers(1, 20, 12)

    found = list(book.meeting(rows, from_ms=from_ms, until_ms=until_ms))

    assert found == [
        (number, one)
        for number, row in enumerate(rows.tolist())
        for one in book.at(row)
        if one.start_ms < until_ms[number] and one.end_ms > from_ms[number]
    ]
