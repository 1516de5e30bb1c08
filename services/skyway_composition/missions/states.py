"""Which state of a mission may follow which."""

from collections.abc import Mapping
from typing import Final

from skyway.contracts.mission import MissionState
from skyway_composition.missions.record import MissionRecord

_NEXT: Final[Mapping[MissionState, tuple[MissionState, ...]]] = {
    "BOOKED": ("ACCEPTED", "REFUSED", "CANCELLED"),
    "ACCEPTED": ("ACTIVE", "ABORTED", "CANCELLED"),
    "ACTIVE": ("COMPLETED", "ABORTED", "CANCELLED"),
    "COMPLETED": (),
    "ABORTED": (),
    "CANCELLED": (),
    "REFUSED": (),
}


def moved(record: MissionRecord, state: MissionState) -> MissionRecord:
    """The record with its mission in the next state.

    Raises
    ------
    ValueError
        That state cannot follow the present one: a bug, since callers look first.
    """
    if state not in _NEXT[record.mission.state]:
        raise ValueError(f"{record.mission_id}: {record.mission.state} cannot become {state}")
    return record.moved_to(state)
