"""When and where the drones of a shortlist can begin their next missions."""

from datetime import UTC, datetime
from typing import Any

import pytest
from skyway_composition.margins import HAND_OVER
from skyway_composition.planning.availability import (
    Availability,
    BookedMission,
)

from skyway.contracts.shortlist import Shortlist
from skyway.ids import DroneId, MissionId, StationId
from skyway.runtime.clock import ManualClock
from skyway.scheduling.stays import Slot, Stay

DRONE = DroneId("drn_1")
B = StationId("b")
DAY_MS = 24 * 3_600_000
BEGINS_MS = 1_000_000


def a_clock(rate: float = 1.0) -> ManualClock:
    return ManualClock(datetime(2026, 3, 1, tzinfo=UTC), rate=rate)


def last(number: int = 1, *, free_ms: int = BEGINS_MS, soc: float = 0.5) -> BookedMission:
    """A mission after which the drone stands at b from `free_ms` on."""
    stays = (Stay(B, free_ms, None, soc, soc),)
    return BookedMission(DRONE, MissionId(f"msn_{number}"), start_ms=number, stays=stays)


def available(*missions: BookedMission, rate: float = 1.0) -> Availability:
    return Availability.of(missions, begins_ms=BEGINS_MS, clock=a_clock(rate))


def test_a_drone_begins_where_its_last_mission_leaves_it() -> None:
    found = available(last(2, free_ms=BEGINS_MS + 60_000), last(1))

    assert found.openings[DRONE].after == "msn_2"
    assert found.openings[DRONE].slot == Slot(B, BEGINS_MS + 60_000 + 30_000, 0.5)
    assert found.busy == {}


@pytest.mark.parametrize(
    ("rate", "hand_over_ms"), [(1.0, 30_000), (60.0, 90_000), (600.0, 900_000)]
)
def test_the_hand_over_takes_fleet_time_or_wall_time(rate: float, hand_over_ms: int) -> None:
    assert HAND_OVER.ms(a_clock(rate)) == hand_over_ms
    free_ms = BEGINS_MS + DAY_MS // 2
    found = available(last(free_ms=free_ms), rate=rate)
    assert found.openings[DRONE].slot.at_ms == free_ms + hand_over_ms


def test_a_drone_that_is_free_now_can_still_begin_at_the_earliest_start() -> None:
    found = available(last(free_ms=0))

    assert found.openings[DRONE].slot.at_ms == BEGINS_MS


@pytest.mark.parametrize(("later_ms", "is_busy"), [(0, False), (1, True)])
def test_a_drone_that_is_free_after_the_horizon_is_busy(later_ms: int, is_busy: bool) -> None:
    free_ms = BEGINS_MS + DAY_MS - HAND_OVER.ms(a_clock()) + later_ms

    found = available(last(free_ms=free_ms))

    free_at_ms = BEGINS_MS + DAY_MS + later_ms
    assert found.busy == ({DRONE: free_at_ms} if is_busy else {})
    assert (DRONE in found.openings) == (not is_busy)


def test_a_drone_is_busy_while_the_plan_of_its_last_mission_is_in_question() -> None:
    unsure = BookedMission(DRONE, MissionId("msn_2"), start_ms=2)

    found = available(last(1), unsure)

    assert found.busy == {DRONE: None}


def test_a_drone_that_flies_only_a_mission_that_is_over_here_is_busy() -> None:
    assert available(BookedMission(DRONE, None, start_ms=-1)).busy == {DRONE: None}


def test_a_drone_that_reports_an_old_mission_begins_after_its_planned_ones() -> None:
    found = available(BookedMission(DRONE, None, start_ms=-1), last(1))

    assert found.openings[DRONE].after == "msn_1"


def test_a_drone_is_placed_where_it_begins_and_keeps_a_charge_at_its_reserve(make: Any) -> None:
    shortlist = Shortlist.of([make.candidate(1), make.candidate(2)])

    placed = available(last(soc=0.05)).placed(shortlist)

    assert (placed.station_ids[0], placed.socs[0]) == ("b", 0.05)
    assert (placed.station_ids[1], placed.socs[1]) == (
        shortlist.station_ids[1],
        shortlist.socs[1],
    )


def test_a_held_drone_is_busy_and_has_no_gap() -> None:
    later = BookedMission(
        DRONE,
        MissionId("msn_2"),
        start_ms=BEGINS_MS + DAY_MS // 2,
        start=Slot(B, BEGINS_MS + DAY_MS // 2, 0.5),
    )
    held = BookedMission(DRONE, None, start_ms=2 * DAY_MS, is_held=True)

    def gaps(*missions: BookedMission) -> list[Availability]:
        return [*Availability.in_gaps(missions, begins_ms=BEGINS_MS, clock=a_clock())]

    assert len(gaps(later)) == 1
    assert gaps(later, held) == []
    assert DRONE in available(later, held).busy
