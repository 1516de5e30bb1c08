"""Chooses where, when and with what charge a drone's next mission begins."""

from collections.abc import Sequence
from dataclasses import dataclass

from skyway.ids import StationId
from skyway.scheduling.stays import Stay

#: A charge that is smaller by less than this counts as the planned charge: sensors are no better.
_SAME_SOC = 0.005


@dataclass(frozen=True, slots=True)
class Slot:
    """A drone can begin a mission at a station from `at_ms` on, with at least this charge."""

    station_id: StationId
    at_ms: int
    soc: float

    def allows(self, planned: "Slot") -> bool:
        """Whether a mission that was planned from there can begin here: same place, same charge."""
        return self.station_id == planned.station_id and self.soc >= planned.soc - _SAME_SOC


def first_slot(stays: Sequence[Stay], *, not_before_ms: int) -> Slot | None:
    """The earliest slot at or after a moment; None without stays.

    A drone that charges can stop charging at any moment. A drone in flight is free at its next
    landing.
    """
    for stay in stays:
        if stay.until_ms is None or stay.until_ms >= not_before_ms:
            at_ms = max(stay.from_ms, not_before_ms)
            return Slot(stay.station_id, at_ms, stay.soc_at(at_ms))
    return None


def slot_after(stays: Sequence[Stay], *, not_before_ms: int, hand_over_ms: int) -> Slot | None:
    """The earliest slot after a mission with these stays; None without stays.

    The slot begins `hand_over_ms` after the drone has ended the mission.
    """
    slot = first_slot(stays, not_before_ms=not_before_ms - hand_over_ms)
    return None if slot is None else Slot(slot.station_id, slot.at_ms + hand_over_ms, slot.soc)


def stay_to_begin_at(
    stays: Sequence[Stay], planned: Slot, *, not_left_before_ms: int
) -> Stay | None:
    """The stay at which a mission can begin as planned; None when its plan does not fit.

    The drone must be there in time and with the planned charge, and must not leave before
    `not_left_before_ms`: until then it can be instructed to stay.
    """
    for stay in stays:
        is_left = stay.until_ms is not None and stay.until_ms < not_left_before_ms
        if is_left or stay.station_id != planned.station_id or stay.from_ms > planned.at_ms:
            continue
        if stay.soc_at(planned.at_ms) >= planned.soc - _SAME_SOC:
            return stay
    return None
