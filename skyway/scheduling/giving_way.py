"""A standby gives way to the services of other drones: which of its pads count as free then."""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Final

from skyway.ids import DroneId, MissionId
from skyway.scheduling.stays import Stay, first_slot
from skyway.scheduling.trip import BookedPad

#: A standby gives way only to a delivery that comes this much sooner, milliseconds: one minute.
#: Less is lost while the drone of the standby is asked. Our own choice.
WORTH_MS: Final = 60_000


@dataclass(frozen=True, slots=True)
class YieldingStandby:
    """The standby at the end of a drone's calendar; another one may be planned for it.

    `stays` are where the drone stands after its last hand-over, `pads` all that its mission has
    reserved. With `is_sent` its drone flies by it, and must accept another one. `calendar_version`
    is the number of the drone's calendar.
    """

    mission_id: MissionId
    drone_id: DroneId
    stays: Sequence[Stay]
    pads: Collection[BookedPad]
    is_sent: bool
    calendar_version: int = 0

    def kept_pads(self, *, not_before_ms: int, gap_ms: int) -> tuple[BookedPad, ...]:
        """The pads that the mission needs in any case: until its standby can first change.

        That is where the drone next stands at or after `not_before_ms`. A pad that it leaves then
        stays reserved for `gap_ms`.
        """
        slot = first_slot(self.stays, not_before_ms=not_before_ms)
        if slot is None:
            return tuple(self.pads)
        return tuple(
            replace(each, end_ms=min(each.end_ms, slot.at_ms + gap_ms))
            for each in self.pads
            if each.start_ms < slot.at_ms
        )

    def is_in_the_way(self, needed: Iterable[BookedPad]) -> bool:
        """Whether its mission has reserved one of these pads for some of the time."""
        return any(_overlap(one, other) for one in needed for other in self.pads)


def widened(needed: Iterable[BookedPad], *, by_ms: int) -> tuple[BookedPad, ...]:
    """The same pads for longer: a service that waits for an answer begins a little later."""
    return tuple(replace(each, end_ms=each.end_ms + by_ms) for each in needed)


def _overlap(one: BookedPad, other: BookedPad) -> bool:
    is_same_pad = (one.station_id, one.pad) == (other.station_id, other.pad)
    return is_same_pad and one.start_ms < other.end_ms and other.start_ms < one.end_ms
