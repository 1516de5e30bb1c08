"""Since when this process has received and handled every message of its drones.

A drone's silence proves something only to a process that has listened all the time. A process that
was started later, lost its connection, was frozen or dropped messages may have missed an answer. A
process that did not own the drone all the time may have missed one too, because another replica
handled the drone's messages.
"""

from datetime import datetime, timedelta
from typing import Final

from skyway.ids import DroneId
from skyway.runtime.clock import FleetClock
from skyway.runtime.replicas.membership import Membership

#: The most drones of which a missed message is remembered; then it counts for all drones.
_MOST_MISSED: Final = 10_000

#: A longer pause between two looks at the clock means that this process was frozen. Wall time.
_LONGEST_PAUSE: Final = timedelta(seconds=5)


class Listening:
    """The span for which no message of a drone was missed, in fleet time."""

    def __init__(self, clock: FleetClock, membership: Membership) -> None:
        self._clock = clock
        self._membership = membership
        self._since_at: datetime | None = None
        self._busy_since_at: datetime | None = None
        self._looked_wall_at: datetime | None = None
        self._missed_at: dict[DroneId, datetime] = {}

    @property
    def replicas(self) -> int:
        """How many replicas share the drones."""
        return self._membership.listeners

    def owns(self, drone_id: DroneId) -> bool:
        """Whether this replica handles the messages of a drone now."""
        return self._membership.owns(drone_id)

    def begin(self) -> None:
        """Everything before this moment may have been missed; from now on nothing is."""
        self._since_at = self._clock.now()
        self._missed_at.clear()

    def miss(self, drone_id: DroneId) -> None:
        """A message of this drone was not taken; it may have been the answer to an instruction."""
        self._missed_at[drone_id] = self._clock.now()
        if len(self._missed_at) > _MOST_MISSED and self._since_at is not None:
            self.begin()

    def end(self) -> None:
        """Messages are missed from now on, until `begin`."""
        self._since_at = None

    def begin_batch(self) -> None:
        """Messages are being handled; they count as handled at `end_batch`."""
        self._busy_since_at = self._busy_since_at or self._clock.now()

    def end_batch(self) -> None:
        """All messages that had arrived before the last `begin_batch` are handled."""
        self._busy_since_at = None

    def look(self) -> None:
        """Notice a freeze of this process; must be called every second of wall time."""
        wall_at = self._clock.wall_now()
        last = self._looked_wall_at
        if self._since_at is not None and last is not None and wall_at - last > _LONGEST_PAUSE:
            self.begin()
        self._looked_wall_at = wall_at

    def covers(self, drone_id: DroneId, from_at: datetime, until_at: datetime) -> bool:
        """Whether every message of a drone between these moments was received and handled here."""
        if self._since_at is None or self._since_at > from_at:
            return False
        if not self._membership.has_owned(drone_id, from_at):
            return False
        missed_at = self._missed_at.get(drone_id)
        if missed_at is not None and missed_at >= from_at:
            return False
        return self._busy_since_at is None or self._busy_since_at > until_at
