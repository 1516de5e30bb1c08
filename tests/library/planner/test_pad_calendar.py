import math

import pytest

from skyway.planner.pad_book import PadBook, booked_from_ms, booked_until_ms
from skyway.planner.pad_calendar import FreeWindow, PadCalendar, Session
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
