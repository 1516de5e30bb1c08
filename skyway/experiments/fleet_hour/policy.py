"""Policies: where a drone goes after a delivery, and from when on it can be booked again."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import takewhile
from typing import Final, Literal

from skyway.contracts.candidate import Standby
from skyway.scheduling.stays import Stay


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

POLICIES: Final = (
    ONE_AT_A_TIME,
    Policy("free while charging", "HOME", "LANDED"),
    Policy("stay", "STAY", "SERVED"),
    CHAINED_HOME,
    CHAINED,
)
