"""The calendars of a simulated fleet: what each drone flies, and which pads it has reserved."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from skyway.drone.model import DroneModel
from skyway.drone.models import DJI_MATRICE_300_RTK
from skyway.experiments.fleet_hour.cases import Case
from skyway.experiments.fleet_hour.mission import HourMission
from skyway.experiments.fleet_hour.policy import Policy
from skyway.planner.pad_book import PadBook
from skyway.scheduling.stays import Slot, Stay, slot_after

#: The services' defaults: the share of energy that plans add, the gap between two drones on one
#: pad, the time between two missions of a drone, and how far ahead a mission is booked.
_ENERGY_MARGIN: Final = 0.15
PAD_GAP_MS: Final = 120_000
HAND_OVER_MS: Final = 30_000
_HORIZON_MS: Final = 24 * 3600 * 1000

#: From a booking until its mission can begin: planned, and sent to the drone.
_PREPARE_MS: Final = 60_000

#: The drone of all fleets as plans see it, with the energy margin.
MODEL: Final[DroneModel] = DJI_MATRICE_300_RTK.model_copy(
    update={"power_empty_w": DJI_MATRICE_300_RTK.power_empty_w * (1 + _ENERGY_MARGIN)}
)


@dataclass(slots=True)
class Calendars:
    """The missions of each drone in order; all drones begin charged and at home."""

    case: Case
    policy: Policy
    missions: list[list[HourMission]] = field(init=False)

    def __post_init__(self) -> None:
        self.missions = [[] for _ in self.case.homes]

    def stays(self, drone: int) -> Sequence[Stay]:
        """Where the next mission of a drone can begin."""
        if not self.missions[drone]:
            return (Stay(self.case.homes[drone], 0, None, MODEL.top_soc, MODEL.top_soc),)
        return self.policy.usable(self.missions[drone][-1].stays)

    def slots(self, now_ms: int) -> Iterator[tuple[int, Slot]]:
        """The drones that can be booked at a moment, and where each can begin."""
        begins_ms = now_ms + _PREPARE_MS
        for drone in range(len(self.missions)):
            stays = self.stays(drone)
            if not self.policy.books_behind and stays[0].from_ms > now_ms:
                continue
            slot = slot_after(stays, not_before_ms=begins_ms, hand_over_ms=HAND_OVER_MS)
            if slot is not None and slot.at_ms <= begins_ms + _HORIZON_MS:
                yield drone, slot

    def free_ms(self, drone: int) -> int:
        """The moment at which the policy counts the drone as free again."""
        return self.stays(drone)[0].from_ms

    def book(self, mission: HourMission) -> None:
        """Add a mission to its drone's calendar; the standby before it ends early."""
        calendar = self.missions[mission.drone]
        if calendar:
            calendar[-1] = calendar[-1].until(mission, hand_over_ms=HAND_OVER_MS)
        calendar.append(mission)

    def pads_for(self, drone: int, *, now_ms: int) -> PadBook:
        """The reservations that bind a drone; its last mission gives way to its next one."""
        row_of = self.case.network.row_of
        entries = [
            (row_of[pad.station_id], pad.pad, pad.start_ms - PAD_GAP_MS, pad.end_ms)
            for other, calendar in enumerate(self.missions)
            for mission in (calendar[:-1] if other == drone else calendar)
            for pad in mission.pads
            if pad.end_ms > now_ms
        ]
        columns = np.array(entries, np.int64).reshape(-1, 4).T
        return PadBook.of_arrays(
            station=columns[0], pad=columns[1], start_ms=columns[2], end_ms=columns[3]
        )
