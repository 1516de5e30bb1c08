"""Keeps a replica in the list of live replicas, and knows its drones now and before.

With SQLite there is one process: it leads, owns every drone, and writes nothing. Its loops rest
while no row needs them.
"""

import logging
from collections import deque
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Final, Self

from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.loops import Loops, Wake, repeat
from skyway.runtime.metrics import Gauge
from skyway.runtime.replicas.replica_store import ReplicaStore
from skyway.runtime.replicas.share import Member, Replicas

log = logging.getLogger(__name__)

#: Seconds of wall time between two beats. A dead replica is replaced within `DEAD_AFTER_MS` plus
#: one beat: 2.8 s.
_BEAT_EVERY_S: Final = 0.7

#: The most changes that are remembered. Before the oldest one, no drone counts as owned.
_MOST_CHANGES: Final = 100

_EVER: Final = datetime.min.replace(tzinfo=UTC)


#: Seconds of wall time between two steps of a rest: longer than between two looks of a loop.
_REST_STEP_S: Final = 2.0


def _nothing() -> None:
    """Begin without preparation."""


class Membership:
    """A replica among the live replicas of its service."""

    def __init__(self, store: ReplicaStore, *, own_id: str, clock: FleetClock) -> None:
        self.own_id = own_id
        self.rest = store.rest
        #: Set when this replica may own more drones than before.
        self.gained = Wake()
        self._store = store
        self._clock = clock
        self._is_listening = False
        self._wake = Wake()
        alone = (Member(0, own_id, is_listening=True),) if store.has_one_process else ()
        #: Each list that was seen, with its first moment in fleet time; the last list counts now.
        self._seen = deque([(_EVER, Replicas(own_id, alone))], maxlen=_MOST_CHANGES)

    async def __aenter__(self) -> Self:
        """Read the live replicas, so that this one owns only its share from the beginning."""
        if not self._store.has_one_process:
            self._note(await self._store.living())
        return self

    async def __aexit__(self, *_: object) -> None:
        """Leave the list, so that the others need not wait until this replica counts as dead."""
        if not self._store.has_one_process:
            with suppress(ServiceUnavailable):
                await self._store.leave(self.own_id)

    def start(self, loops: Loops) -> None:
        """Start the beats; with one process the rests."""
        if self._store.has_one_process:
            loops.start("rest", repeat("rest", self.rest.step, every_s=_REST_STEP_S))
        else:
            beats = repeat("replicas", self.step, every_s=_BEAT_EVERY_S, wake=self._wake)
            loops.start("replicas", beats)

    async def step(self) -> bool:
        """Step of a loop: note that this replica is live, and read the others; always False."""
        self._note(await self._store.beat(self.own_id, is_listening=self._is_listening))
        return False

    def set_listening(self, is_listening: bool) -> None:
        """Note whether this replica receives the messages of drones."""
        self._is_listening = is_listening
        self._wake.set()

    @property
    def leads(self) -> bool:
        """Whether this replica now does the work that one replica does for all."""
        return self._now.leads

    def polls(self) -> bool:
        """Whether this replica looks for work that nothing has woken it for.

        Each replica does the work that it was woken for; the leader finds what others left.
        """
        return self._now.leads and self.looks()

    def looks(self) -> bool:
        """Whether the loops of all replicas look for work now."""
        return not self.rest.is_on

    @property
    def alive(self) -> int:
        """How many replicas are live, as far as this one knows."""
        return max(1, len(self._now.members))

    @property
    def listeners(self) -> int:
        """How many replicas share the drones."""
        return len(self._now.listeners)

    def owns(self, drone_id: str) -> bool:
        """Whether this replica handles the messages of a drone now."""
        return self._now.owns(drone_id)

    def has_owned(self, drone_id: str, since_at: datetime) -> bool:
        """Whether this replica has owned a drone from this moment on until now, fleet time."""
        for from_at, replicas in reversed(self._seen):
            if not replicas.owns(drone_id):
                return False
            if from_at <= since_at:
                return True
        return False

    async def gauges(self) -> list[Gauge]:
        """The number of live replicas, and whether this replica leads."""
        alive = len(self._now.members)
        return [
            Gauge("skyway_replicas", "live replicas of this service, as this one sees them", alive),
            Gauge("skyway_replica_leads", "1 if this replica leads", int(self.leads)),
        ]

    @property
    def _now(self) -> Replicas:
        return self._seen[-1][1]

    def _note(self, members: tuple[Member, ...]) -> None:
        before, now = self._now, Replicas(self.own_id, members)
        if now == before:
            return
        before.forget_owned()
        self._seen.append((self._clock.now(), now))
        log.info("replicas", extra={"alive": len(now.members), "leads": now.leads})
        if now.may_own_more_than(before):
            self.gained.set()


@dataclass(slots=True)
class PollsInTurn:
    """Lets a replica poll in one of so many rounds as there are replicas; for one loop.

    So all replicas together poll as often as one replica that is alone.
    """

    membership: Membership
    _rounds: int = 0

    def __call__(self) -> bool:
        """Whether to poll in this round."""
        self._rounds += 1
        if self._rounds < self.membership.alive:
            return False
        self._rounds = 0
        return self.membership.looks()


@dataclass(slots=True)
class LeaderStep:
    """A step of a loop that only the leader does; `begin` is called when it begins to lead.

    A replica that has lost the lead does the step once more. It may have published old data after
    the new leader published newer data.
    """

    membership: Membership
    step: Callable[[], Awaitable[bool]]
    begin: Callable[[], None] = _nothing
    _led: bool = False

    async def __call__(self) -> bool:
        """Do the step if this replica leads, or led until now."""
        leads = self.membership.leads
        if leads and not self._led:
            self.begin()
        if not leads and not self._led:
            return False
        self._led = True
        has_more = await self.step()
        self._led = leads
        return has_more
