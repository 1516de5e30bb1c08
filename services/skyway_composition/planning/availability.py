"""When and where the drones of a shortlist can begin: now, or after the missions they have."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Final, Self

from skyway.contracts.shortlist import Shortlist
from skyway.ids import DroneId, MissionId
from skyway.runtime.clock import FleetClock, fleet_margin
from skyway.scheduling.slots import Slot, slot_after
from skyway.scheduling.stays import Stay
from skyway.units import moment_to_ms

#: Time between the end of a mission and the start of the next one of the same drone, fleet seconds
#: and wall seconds: the end is reported, and the next mission is sent. Our own choice.
_HAND_OVER_S: Final = (30.0, 1.5)

#: A mission is booked at most this far ahead behind others, fleet milliseconds: one day.
_HORIZON_MS: Final = 24 * 3600 * 1000


@dataclass(frozen=True, slots=True)
class LastMission:
    """The last mission in a drone's calendar, and where another one can begin after it.

    Without stays none can begin now. `mission_id` is None for a drone that reports a mission which
    is over here, or has landed away from every station.
    """

    drone_id: DroneId
    mission_id: MissionId | None
    start_ms: int
    stays: tuple[Stay, ...] = ()


@dataclass(frozen=True, slots=True)
class Succession:
    """A mission can follow another one: it begins at the slot, which includes the hand-over."""

    mission_id: MissionId
    slot: Slot


@dataclass(frozen=True, slots=True)
class Availability:
    """The drones that can begin nothing, and those that begin after a mission they have.

    All other drones begin where the registry saw them. `hand_over_ms` is the time between two
    missions of a drone, in milliseconds of fleet time.
    """

    busy: frozenset[DroneId]
    after: Mapping[DroneId, Succession]
    hand_over_ms: int

    @classmethod
    def of(cls, last_missions: Iterable[LastMission], *, begins_ms: int, clock: FleetClock) -> Self:
        """The availability for missions that begin at `begins_ms` at the earliest."""
        after, hand_over_ms = {}, hand_over_time_ms(clock)
        last_missions = [*last_missions]
        for last in _latest(last_missions):
            slot = slot_after(last.stays, not_before_ms=begins_ms, hand_over_ms=hand_over_ms)
            is_near = slot is not None and slot.at_ms <= begins_ms + _HORIZON_MS
            if slot is not None and is_near and last.mission_id is not None:
                after[last.drone_id] = Succession(last.mission_id, slot)
        busy = frozenset(each.drone_id for each in last_missions if each.drone_id not in after)
        return cls(busy, after, hand_over_ms)

    def placed(self, shortlist: Shortlist) -> Shortlist:
        """The shortlist with each drone where it begins, and with the charge it has then."""
        if not self.after:
            return shortlist
        slots = [self._slot(each) for each in shortlist.drone_ids]
        columns = zip(slots, shortlist.station_ids, shortlist.socs, strict=True)
        placed = [
            (station_id, soc) if slot is None else (slot.station_id, slot.soc)
            for slot, station_id, soc in columns
        ]
        update = {
            "station_ids": tuple(station_id for station_id, _ in placed),
            "socs": tuple(soc for _, soc in placed),
        }
        return shortlist.model_copy(update=update)

    def _slot(self, drone_id: DroneId) -> Slot | None:
        succession = self.after.get(drone_id)
        return None if succession is None else succession.slot


def hand_over_time_ms(clock: FleetClock) -> int:
    """The time between two missions of a drone, fleet milliseconds."""
    fleet_s, wall_s = _HAND_OVER_S
    return round(fleet_margin(clock, fleet_s=fleet_s, wall_s=wall_s).total_seconds() * 1000)


def start_ms(clock: FleetClock, *, earliest_at: datetime | None, margin_factor: int = 1) -> int:
    """The millisecond at which a mission begins: late enough to plan it and reach the drone.

    `margin_factor` multiplies the usual margin.
    """
    start_at = clock.now() + fleet_margin(clock, fleet_s=60, wall_s=2) * margin_factor
    if earliest_at is not None:
        start_at = max(start_at, earliest_at)
    return moment_to_ms(start_at) + 1


def _latest(last_missions: Iterable[LastMission]) -> Iterable[LastMission]:
    """The last mission of each drone; a mission that composition does not know comes first."""
    latest: dict[DroneId, LastMission] = {}
    for each in sorted(last_missions, key=lambda one: one.start_ms):
        latest[each.drone_id] = each
    return latest.values()
