"""A standby gives way only with the pads that its drone does not need yet."""

import pytest

from skyway.ids import DroneId, MissionId, StationId
from skyway.scheduling.giving_way import YieldingStandby, widened
from skyway.scheduling.stays import Stay
from skyway.scheduling.trip import BookedPad

HERE, HOME = StationId("here"), StationId("home")

#: The drone delivers here until 1000, flies home until 2000, and charges there from 2500 to 9000.
STAYS = (
    Stay(HERE, 1_000, 1_000, 0.6, 0.6),
    Stay(HOME, 2_000, 2_500, 0.3, 0.3),
    Stay(HOME, 2_500, 9_000, 0.3, 1.0),
    Stay(HOME, 9_000, None, 1.0, 1.0),
)

#: It charges before its delivery too.
SERVICE = BookedPad(HERE, 0, 100, 400)
CHARGE = BookedPad(HOME, 0, 2_500, 9_100)


def standby(stays: tuple[Stay, ...] = STAYS) -> YieldingStandby:
    return YieldingStandby(MissionId("msn"), DroneId("drn"), stays, (SERVICE, CHARGE), True)


def test_a_service_keeps_its_pads_and_its_standby_gives_way() -> None:
    assert standby().kept_pads(not_before_ms=0, gap_ms=100) == (SERVICE,)


def test_a_drone_in_flight_lands_before_its_standby_can_change() -> None:
    assert standby().kept_pads(not_before_ms=1_500, gap_ms=100) == (SERVICE,)


def test_a_drone_that_charges_keeps_its_pad_until_it_can_leave_and_for_the_gap() -> None:
    kept = standby().kept_pads(not_before_ms=4_000, gap_ms=100)

    assert kept == (SERVICE, BookedPad(HOME, 0, 2_500, 4_100))


def test_a_mission_without_stays_keeps_all_its_pads() -> None:
    assert standby(stays=()).kept_pads(not_before_ms=0, gap_ms=100) == (SERVICE, CHARGE)


@pytest.mark.parametrize(
    ("needed", "is_in_the_way"),
    [
        (BookedPad(HOME, 0, 5_000, 6_000), True),
        (BookedPad(HOME, 0, 9_100, 9_500), False),
        (BookedPad(HOME, 0, 2_000, 2_500), False),
        (BookedPad(HOME, 1, 5_000, 6_000), False),
        (BookedPad(HERE, 0, 5_000, 6_000), False),
    ],
)
def test_only_the_same_pad_at_the_same_time_is_in_the_way(
    needed: BookedPad, is_in_the_way: bool
) -> None:
    assert standby().is_in_the_way([needed]) is is_in_the_way


def test_a_pad_is_left_free_for_longer_than_planned() -> None:
    [wider] = widened([CHARGE], by_ms=60)

    assert (wider.start_ms, wider.end_ms) == (2_500, 9_160)
