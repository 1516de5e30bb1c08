"""A booked mission of the simulation, and how it gives way to the next one."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from skyway.delivery.plan import Fly
from skyway.experiments.fleet_hour.cases import HourRequest
from skyway.scheduling.booked_pad import BookedPad, without
from skyway.scheduling.standby import shortened_trip
from skyway.scheduling.stays import Slot, Stay, stays_of_standby
from skyway.scheduling.trip import PlacedStep, Trip


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
