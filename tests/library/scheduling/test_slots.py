"""Where, when and with what charge a drone's next mission begins."""

import pytest

from skyway.ids import StationId
from skyway.scheduling.slots import Slot, first_slot, slot_after, stay_to_begin_at
from skyway.scheduling.stays import Stay

B, HOME = StationId("b"), StationId("home")
#: The drone delivers at b at 100, leaves immediately, charges at home from 200 to 400.
STAYS = (
    Stay(B, 100, 100, 0.5, 0.5),
    Stay(HOME, 200, 400, 0.3, 0.9),
    Stay(HOME, 400, None, 0.9, 0.9),
)


@pytest.mark.parametrize(
    ("not_before_ms", "slot"),
    [
        (0, Slot(B, 100, 0.5)),
        (100, Slot(B, 100, 0.5)),
        (101, Slot(HOME, 200, 0.3)),
        (300, Slot(HOME, 300, 0.6)),
        (1_000, Slot(HOME, 1_000, 0.9)),
    ],
)
def test_the_first_slot_is_at_the_next_landing_or_within_a_stay(
    not_before_ms: int, slot: Slot
) -> None:
    found = first_slot(STAYS, not_before_ms=not_before_ms)

    assert found is not None
    assert (found.station_id, found.at_ms) == (slot.station_id, slot.at_ms)
    assert found.soc == pytest.approx(slot.soc)


def test_without_stays_there_is_no_slot() -> None:
    assert first_slot((), not_before_ms=0) is None
    assert slot_after((), not_before_ms=0, hand_over_ms=30) is None


def test_a_slot_after_a_mission_includes_the_hand_over() -> None:
    assert slot_after(STAYS, not_before_ms=0, hand_over_ms=30) == Slot(B, 130, 0.5)
    assert slot_after(STAYS, not_before_ms=1_000, hand_over_ms=30) == Slot(HOME, 1_000, 0.9)


@pytest.mark.parametrize(
    ("planned", "not_left_before_ms", "stay"),
    [
        (Slot(B, 100, 0.5), 50, STAYS[0]),
        (Slot(B, 130, 0.5), 50, STAYS[0]),  # it waits at b for its next mission
        (Slot(B, 130, 0.5), 101, None),  # it has left b
        (Slot(B, 90, 0.5), 50, None),  # it is not there yet
        (Slot(B, 100, 0.6), 50, None),  # it has too little charge
        (Slot(HOME, 300, 0.6), 50, STAYS[1]),
        (Slot(StationId("c"), 300, 0.1), 50, None),
    ],
)
def test_a_mission_fits_where_its_drone_stands_in_time_and_charged(
    planned: Slot, not_left_before_ms: int, stay: Stay | None
) -> None:
    assert stay_to_begin_at(STAYS, planned, not_left_before_ms=not_left_before_ms) == stay
