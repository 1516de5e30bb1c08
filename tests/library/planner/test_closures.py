import math
from datetime import UTC, datetime, timedelta

import pytest

from skyway.geo import Position
from skyway.ids import StationId, ZoneId
from skyway.network.network import Zone
from skyway.planner.airspace import Airspace
from skyway.planner.closures import Closures, Use
from skyway.planner.exact_task import closed_of
from skyway.planner.pad_book import NO_RESERVATIONS
from skyway.planner.situation import Situation

START = datetime(2026, 1, 1, tzinfo=UTC)
A, B, C, D = (StationId(name) for name in "abcd")
A_TO_B = (A, B)


def fly(duration_s: float = 10.0, after_s: float = 0.0) -> Use:
    return Use(A_TO_B, after_s, duration_s)


def closed(*intervals: tuple[float, float]) -> Closures:
    return Closures({A_TO_B: intervals, B: [(100.0, 200.0)]})


@pytest.mark.parametrize(
    ("not_before_s", "leaves_s"),
    [(0.0, 0.0), (40.0, 40.0), (40.001, 60.0), (50.0, 60.0), (60.0, 60.0), (70.0, 70.0)],
)
def test_a_flight_may_touch_a_closure_at_both_ends(not_before_s: float, leaves_s: float):
    departure = closed((50.0, 60.0)).earliest_departure([fly()], not_before_s=not_before_s)

    assert departure.at_s == leaves_s


def test_a_flight_that_starts_later_in_a_hop_delays_the_whole_hop():
    departure = closed((50.0, 60.0)).earliest_departure([fly(after_s=30.0)], not_before_s=15.0)

    assert (departure.at_s, departure.because_of) == (30.0, A_TO_B)


def test_overlapping_closures_end_together():
    closures = closed((50.0, 60.0), (55.0, 80.0), (85.0, 90.0))

    assert closures.earliest_departure([fly()], not_before_s=45.0).at_s == 90.0


def test_a_closure_without_end_never_ends():
    closures = closed((50.0, math.inf))

    departure = closures.earliest_departure([fly()], not_before_s=45.0)

    assert (departure.at_s, departure.because_of) == (math.inf, A_TO_B)


def test_a_landing_is_a_moment_and_may_not_lie_in_a_closure():
    landing = Use(B, 10.0, 0.0)

    assert closed().earliest_departure([landing], not_before_s=89.0).at_s == 89.0
    assert closed().earliest_departure([landing], not_before_s=90.0).at_s == 190.0


@pytest.mark.parametrize(
    ("intervals", "is_for_good"),
    [
        ([(0.0, math.inf)], True),
        ([(-5.0, 10.0), (10.0, math.inf)], True),
        ([(1.0, math.inf)], False),
        ([(-5.0, 1e9)], False),
    ],
)
def test_only_a_closure_from_the_start_without_end_closes_for_good(intervals, is_for_good):
    assert closed(*intervals).is_closed_for_good(A_TO_B) is is_for_good


@pytest.mark.parametrize(
    ("back", "is_two_way"),
    [([(0.0, math.inf)], True), ([(5.0, math.inf)], False), ([], False)],
)
def test_closures_keep_a_network_two_way_if_they_close_both_directions_for_good(
    make_problem, back: list[tuple[float, float]], is_two_way: bool
):
    problem = make_problem("a-b:5", "b")
    closures = Closures({(A, B): [(0.0, math.inf)], (B, A): back, A: [(0.0, math.inf)]})
    situation = Situation(problem, closures, (NO_RESERVATIONS, NO_RESERVATIONS))

    assert closed_of(situation).is_two_way is is_two_way


def test_a_zone_closes_the_segments_that_meet_it_while_it_is_active(make_network, make_problem):
    corners = [(0.009, -1.0), (0.011, -1.0), (0.011, 1.0), (0.009, 1.0), (0.009, -1.0)]
    zone = Zone(
        ZoneId("z"),
        (tuple(Position(*corner) for corner in corners),),
        active_from=START + timedelta(seconds=50),
        active_until=START + timedelta(seconds=60),
    )
    network = make_network("a-b:1 b-c:1 c-d:1", zones=[zone])  # b stands in the zone
    problem = make_problem(network, "b", start_at=START)

    closures = Closures.of(problem, Airspace.of(network))

    for use in (fly(), Use((C, B), 0.0, 10.0), Use(B, 0.0, 0.0)):
        assert closures.earliest_departure([use], not_before_s=55.0).at_s == 60.0
    for use in (Use((C, D), 0.0, 10.0), Use(A, 0.0, 0.0)):
        assert closures.earliest_departure([use], not_before_s=55.0).at_s == 55.0
