"""When and where the drones of a shortlist can begin: now, between missions, or after them."""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from itertools import pairwise
from typing import Final, Self

from skyway.contracts.shortlist import Shortlist
from skyway.delivery.qos import QoS
from skyway.ids import DroneId, MissionId
from skyway.runtime.clock import FleetClock
from skyway.scheduling.stays import Slot, Stay, slot_after
from skyway.units import moment_to_ms
from skyway_composition.margins import (
    BOOKED_TO_START,
    HAND_OVER,
    SENT_AHEAD,
    SENT_AHEAD_WAITING,
)

#: A mission is booked at most this far ahead behind others, fleet milliseconds: one day.
_HORIZON_MS: Final = 24 * 3600 * 1000

#: No mission is planned in a shorter gap between two missions, fleet milliseconds. Our own choice.
_SHORTEST_GAP_MS: Final = 10 * 60 * 1000

#: At most this many gaps of a drone are tried, the earliest ones. Our own choice.
_MOST_GAPS: Final = 3


@dataclass(frozen=True, slots=True)
class BookedMission:
    """A mission in a drone's calendar, and where another one can begin after it.

    Without stays none can begin now. `mission_id` is None for a drone that reports a mission which
    is over here, or has landed away from every station. `start` is given while it is QUEUED.
    `is_held` stands for an offer that is held: nothing is booked before or after it.
    """

    drone_id: DroneId
    mission_id: MissionId | None
    start_ms: int
    stays: tuple[Stay, ...] = ()
    start: Slot | None = None
    is_held: bool = False


@dataclass(frozen=True, slots=True)
class NextMission:
    """The QUEUED mission after a gap, and when, where and with what charge its drone must be ready.

    The moment is a hand-over before the mission begins.
    """

    mission_id: MissionId
    ready: Slot


@dataclass(frozen=True, slots=True)
class Opening:
    """A place for a mission in a drone's calendar; its slot includes the hand-over.

    `after` is the mission before; None when the drone is idle until `before`, the mission after it.
    """

    slot: Slot
    after: MissionId | None
    before: NextMission | None = None

    @property
    def neighbours(self) -> tuple[MissionId, ...]:
        """The missions of the same drone before and after; their pads are free for this mission."""
        before = None if self.before is None else self.before.mission_id
        return tuple(each for each in (self.after, before) if each is not None)


@dataclass(frozen=True, slots=True)
class Availability:
    """The drones that can begin nothing, and the openings in the calendars of the others.

    A `busy` drone has the moment at which it can begin a mission, beyond the horizon; None if that
    is not known. Drones without an opening begin where the registry saw them. `hand_over_ms` is the
    time between two missions of a drone. All in milliseconds of fleet time.
    """

    busy: Mapping[DroneId, int | None]
    openings: Mapping[DroneId, Opening]
    hand_over_ms: int

    @classmethod
    def of(cls, booked: Iterable[BookedMission], *, begins_ms: int, clock: FleetClock) -> Self:
        """The availability after all that is booked, from `begins_ms` on."""
        openings: dict[DroneId, Opening] = {}
        busy: dict[DroneId, int | None] = {}
        hand_over_ms = HAND_OVER.ms(clock)
        for drone_id, missions in _calendars(booked).items():
            last = missions[-1]
            slot = slot_after(last.stays, not_before_ms=begins_ms, hand_over_ms=hand_over_ms)
            is_near = slot is not None and slot.at_ms <= begins_ms + _HORIZON_MS
            if slot is not None and is_near and last.mission_id is not None:
                openings[drone_id] = Opening(slot, last.mission_id)
            else:
                busy[drone_id] = None if slot is None else slot.at_ms
        return cls(busy, openings, hand_over_ms)

    @classmethod
    def in_gaps(
        cls, booked: Iterable[BookedMission], *, begins_ms: int, clock: FleetClock
    ) -> Iterator[Self]:
        """The availability in the gaps of calendars: first the first gap of each drone, and so on.

        Drones without another gap have no opening, and are to be left out.
        """
        hand_over_ms = HAND_OVER.ms(clock)
        gaps = {
            drone_id: [*_gaps(missions, begins_ms, hand_over_ms)][:_MOST_GAPS]
            for drone_id, missions in _calendars(booked).items()
        }
        for number in range(max(map(len, gaps.values()), default=0)):
            openings = {
                drone_id: own[number] for drone_id, own in gaps.items() if number < len(own)
            }
            yield cls({}, openings, hand_over_ms)

    def placed(self, shortlist: Shortlist) -> Shortlist:
        """The shortlist with each drone where it begins, and with the charge it has then."""
        if not self.openings:
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
        opening = self.openings.get(drone_id)
        return None if opening is None else opening.slot


def start_ms(clock: FleetClock, *, earliest_at: datetime | None, margin_factor: int = 1) -> int:
    """The millisecond at which a mission begins: late enough to plan it and reach the drone.

    `margin_factor` multiplies the usual margin.
    """
    start_at = clock.now() + BOOKED_TO_START.span(clock) * margin_factor
    if earliest_at is not None:
        start_at = max(start_at, earliest_at)
    return moment_to_ms(start_at) + 1


def send_ahead_ms(clock: FleetClock, qos: QoS | None = None) -> int:
    """How long before its start a mission is sent to an idle drone, fleet milliseconds."""
    waits = qos is not None and qos.pooling_wait_s > 0
    return (SENT_AHEAD_WAITING if waits else SENT_AHEAD).ms(clock)


def _calendars(booked: Iterable[BookedMission]) -> Mapping[DroneId, Sequence[BookedMission]]:
    """The missions of each drone in order; a mission that composition does not know comes first."""
    calendars: dict[DroneId, list[BookedMission]] = defaultdict(list)
    for each in sorted(booked, key=lambda one: one.start_ms):
        calendars[each.drone_id].append(each)
    return calendars


def _gaps(
    missions: Sequence[BookedMission], begins_ms: int, hand_over_ms: int
) -> Iterator[Opening]:
    """The gaps in one drone's calendar that are long enough, in order."""
    first = missions[0]
    if missions[-1].is_held:
        return
    if first.start is not None and first.mission_id is not None:
        # The drone is idle, and stands where its next mission begins.
        here = Slot(first.start.station_id, begins_ms, first.start.soc)
        yield from _gap(here, None, first, hand_over_ms)
    for before, after in pairwise(missions):
        slot = slot_after(before.stays, not_before_ms=begins_ms, hand_over_ms=hand_over_ms)
        if slot is not None and before.mission_id is not None:
            yield from _gap(slot, before.mission_id, after, hand_over_ms)


def _gap(
    slot: Slot, after: MissionId | None, following: BookedMission, hand_over_ms: int
) -> Iterator[Opening]:
    """The opening before a QUEUED mission, if it is long enough."""
    start = following.start
    if start is None or following.mission_id is None:
        return
    ready = Slot(start.station_id, start.at_ms - hand_over_ms, start.soc)
    if ready.at_ms - slot.at_ms >= _SHORTEST_GAP_MS:
        yield Opening(slot, after, NextMission(following.mission_id, ready))
