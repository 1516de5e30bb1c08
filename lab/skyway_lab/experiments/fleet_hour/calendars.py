"""The calendars of a simulated fleet under a policy: the missions of each drone, and its pads."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, takewhile
from typing import Final, Literal

import numpy as np

from skyway.contracts.candidate import Standby
from skyway.delivery.plan import Fly
from skyway.drone.model import DroneModel
from skyway.drone.models import DJI_MATRICE_300_RTK
from skyway.ids import StationId
from skyway.planner.pad_book import PadBook
from skyway.scheduling.repositioning import PastRequest
from skyway.scheduling.stays import Slot, Stay, slot_after, stays_of_standby
from skyway.scheduling.trip import BookedPad, PlacedStep, Trip, shortened_trip, without
from skyway_lab.experiments.fleet_hour.cases import Case, HourRequest

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


@dataclass(frozen=True, slots=True)
class Policy:
    """How the drones of a fleet are booked.

    Parameters
    ----------
    standby
        What a drone does after its last hand-over.
    free_when
        When a drone is free: when it is CHARGED, when it has LANDED at its standby, or when it has
        SERVED its request.
    books_behind
        Whether a request is booked behind busy drones. Otherwise it waits until a drone is free.
    """

    name: str
    standby: Standby
    free_when: Literal["CHARGED", "LANDED", "SERVED"]
    books_behind: bool = False

    def usable(self, stays: Sequence[Stay]) -> Sequence[Stay]:
        """The stays at which another mission can begin."""
        if self.free_when == "CHARGED":
            return stays[-1:]
        if self.free_when == "LANDED":
            end = stays[-1].station_id
            at_end = [*takewhile(lambda each: each.station_id == end, reversed(stays))]
            return at_end[::-1]
        return stays


ONE_AT_A_TIME: Final = Policy("one at a time", "HOME", "CHARGED")

CHAINED_HOME: Final = Policy("chained, home", "HOME", "SERVED", books_behind=True)

CHAINED: Final = Policy("chained", "STAY", "SERVED", books_behind=True)

#: Not among the policies of the experiment: `python -m skyway_lab dispatch` compares it.
CHAINED_NEAR: Final = Policy("chained, next pickup", "NEXT_PICKUP", "SERVED", books_behind=True)

POLICIES: Final = (
    ONE_AT_A_TIME,
    Policy("free while charging", "HOME", "LANDED"),
    Policy("stay", "STAY", "SERVED"),
    CHAINED_HOME,
    CHAINED,
)


@dataclass(frozen=True, slots=True)
class HourMission:
    """A trip of one drone for one request.

    `stays` are where the drone stands after its last hand-over, `pads` what it has reserved.
    """

    request: HourRequest
    drone: int
    slot: Slot
    trip: Trip
    stays: tuple[Stay, ...]
    pads: tuple[BookedPad, ...]

    @classmethod
    def of(cls, request: HourRequest, drone: int, slot: Slot, trip: Trip) -> "HourMission":
        """The mission of a trip that begins at this slot."""
        stays = stays_of_standby(
            trip.plan,
            start_ms=trip.start_ms,
            soc=slot.soc,
            home_plan=trip.home_plan,
            home_recharge=trip.home_recharge,
        )
        return cls(request, drone, slot, trip, stays, trip.booked_pads)

    @property
    def served_ms(self) -> int:
        """The end of the last hand-over, which is that of the last delivery."""
        return self.trip.home_start_ms

    @property
    def energy_j(self) -> float:
        """The energy of all flights."""
        return sum(each.step.energy_j for each in self.steps() if isinstance(each.step, Fly))

    def steps(self) -> Iterator[PlacedStep]:
        """Everything that the drone does, in time order."""
        return self.trip.steps()

    def until(self, following: "HourMission", *, hand_over_ms: int) -> "HourMission":
        """The mission whose standby ends early enough for the mission that follows it."""
        until_ms = following.slot.at_ms - hand_over_ms
        trip = shortened_trip(self.trip, max(until_ms, self.trip.home_start_ms))
        return replace(self, trip=trip, pads=without(trip.booked_pads, following.pads))


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

    def waiting(self, drone: int) -> Counter[StationId]:
        """How many drones beside this one wait at each station, or will after their missions."""
        others = (each for each in range(len(self.missions)) if each != drone)
        return Counter(self.stays(each)[-1].station_id for each in others)

    def past_requests(self) -> Iterator[PastRequest]:
        """The requests of earlier days, and those that were booked."""
        yield from self.case.past
        for mission in chain.from_iterable(self.missions):
            yield PastRequest(mission.request.source, mission.request.asked_ms)

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
