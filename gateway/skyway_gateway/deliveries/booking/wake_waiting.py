"""Wakes waiting requests when something changes that may help them.

What may help: a mission ended or was refused, a drone came online, an operator or a provider
changed something through this gateway. A wake that is lost costs seconds, because every waiting
request is also tried again by and by.

A drone can report as often as its broker lets it. So only a drone counts that was not online
before, a provider's drones count once in ten seconds, and all drones once in a second. A drone that
does not count misses little: the requests that were woken just before are tried again 0.5, 1, 2, 4
and 8 seconds later.
"""

import random
from collections.abc import AsyncIterator, Iterable
from datetime import datetime, timedelta
from typing import Final, Never

from skyway.announced_networks import CachedNetworks
from skyway.contracts.drone_report import Connection
from skyway.contracts.quote import HOLD_GRACE_S
from skyway.ids import NetworkId, StationId
from skyway.runtime.clock import FleetClock
from skyway.runtime.loops import Wake
from skyway.runtime.mqtt.inbox import Received
from skyway.runtime.sql.database import Database
from skyway_gateway.deliveries.booking.queue_store import waiting_networks, wake_first
from skyway_gateway.quotes.store import has_hold_ended

_PAUSE: Final = timedelta(seconds=1)
_PAUSE_OF_PROVIDER: Final = timedelta(seconds=10)

#: Of more drones, those that came online first are forgotten, and count when they report again.
_MOST_DRONES: Final = 50_000


class DronesOnline:
    """The drones that are online, as far as this process remembers."""

    def __init__(self, *, most_drones: int = _MOST_DRONES) -> None:
        self._most_drones = most_drones
        #: The ids of provider and drone.
        self._online: dict[tuple[str, ...], None] = {}
        self._counted_at: datetime | None = None
        #: When a drone of a provider counted last, the longest ago first.
        self._counted_of: dict[str, datetime] = {}

    def note(self, batch: Iterable[Received[Connection]], *, now: datetime) -> bool:
        """Remember who is online now; whether this may help requests that wait for a drone."""
        came = {
            received.ids[0]
            for received in batch
            if self._has_come(received.ids, is_online=received.message.status == "ONLINE")
        }
        self._forget_before(now - _PAUSE_OF_PROVIDER)
        new = came - self._counted_of.keys()
        if not new or (self._counted_at is not None and now - self._counted_at < _PAUSE):
            return False
        self._counted_at = now
        self._counted_of.update(dict.fromkeys(new, now))
        return True

    def _has_come(self, ids: tuple[str, ...], *, is_online: bool) -> bool:
        if not is_online:
            self._online.pop(ids, None)
            return False
        is_new = ids not in self._online
        self._online[ids] = None
        if len(self._online) > self._most_drones:
            del self._online[next(iter(self._online))]
        return is_new

    def _forget_before(self, at: datetime) -> None:
        """Let the providers count again whose pause is over: at most one a second is remembered."""
        for provider_id, counted_at in list(self._counted_of.items()):
            if counted_at > at:
                return
            del self._counted_of[provider_id]


#: The first tries after a wake, wall time since it; after the last of them every `_LONGEST`.
_FIRST_TRIES: Final = tuple(timedelta(seconds=each) for each in (0.5, 1, 2, 4, 8))
_LONGEST: Final = timedelta(seconds=10)

#: Seconds until the next round after one that could not ask: least and most. After a lost answer
#: the most grows to this share of the time since composition was first asked, and no further than
#: `_LONGEST`.
_RETRY_S: Final = (0.5, 3.0)
_SHARE_OF_AGE: Final = 0.5

#: Composition holds an offer so much longer than its quote says.
_GRACE: Final = timedelta(seconds=HOLD_GRACE_S)


def next_try_at(*, woken_at: datetime, now: datetime) -> datetime:
    """When a request that found no drone is tried again.

    The tries come 0.5, 1, 2, 4 and 8 seconds after its wake: other services learn of the change a
    little later than this one. After that they come every 10 seconds. Requests that were woken
    together are due at the same moments, so that each time they are tried in their order.
    """
    since = max(now - woken_at, timedelta())
    for wait in _FIRST_TRIES:
        if since < wait:
            return woken_at + wait
    tens = (since - _FIRST_TRIES[-1]) // _LONGEST + 1
    return woken_at + _FIRST_TRIES[-1] + tens * _LONGEST


def retry_at(now: datetime, *, asked_at: datetime | None, chance: random.Random) -> datetime:
    """When a request is tried again that could not be booked because a service did not answer.

    `asked_at` is since when an answer of composition is missing, wall time.
    """
    least_s, most_s = _RETRY_S
    if asked_at is not None:
        longest_s = min((now - asked_at) * _SHARE_OF_AGE, _LONGEST).total_seconds()
        least_s, most_s = max(least_s, longest_s / 2), max(most_s, longest_s)
    return now + timedelta(seconds=chance.uniform(least_s, most_s))


class Waker:
    """Wakes the first waiting requests of a network, or of all networks; `queued` wakes booking."""

    def __init__(
        self, db: Database, clock: FleetClock, networks: CachedNetworks, queued: Wake
    ) -> None:
        self.noted = Wake()
        self._db = db
        self._clock = clock
        self._networks = networks
        self._queued = queued
        self._changed = set[NetworkId | None]()
        self._waiting = frozenset[NetworkId | None]()
        self._holds_seen_until: datetime | None = None
        self._online = DronesOnline()

    def note_change_around(self, station_id: StationId) -> None:
        """Note a change that may help requests in the network of this station."""
        self.note_change(self._networks.network_of(station_id))

    def note_change(self, network_id: NetworkId | None = None) -> None:
        """Note a change that may help requests in a network; None means in any network."""
        self._changed.add(network_id)
        self.noted.set()

    def note_waiting(self, network_id: NetworkId | None) -> None:
        """Note that a request begins to wait."""
        self._waiting |= {network_id}

    def has_waiting(self, network_id: NetworkId | None) -> bool:
        """Whether requests of this network wait, as far as this process knows."""
        return network_id in self._waiting

    async def step(self) -> bool:
        """Step of a loop: wake the first requests where something changed; always False."""
        changed, self._changed = self._changed, set()
        try:
            self._waiting = await waiting_networks(self._db)
            if self._waiting and await self._has_hold_ended():
                changed.add(None)
            for network_id in changed if self._waiting else ():
                if await wake_first(self._db, network_id, wall_at=self._clock.wall_now()):
                    self._queued.set()
        except BaseException:
            self._changed |= changed
            raise
        return False

    async def _has_hold_ended(self) -> bool:
        """Whether offers have stopped being held since the last look: their drones are free."""
        until = self._clock.wall_now() - _GRACE
        after, self._holds_seen_until = self._holds_seen_until or until - _LONGEST, until
        async with self._db.read() as connection:
            return await has_hold_ended(connection, after=after, until=until)

    async def follow(self, connections: AsyncIterator[list[Received[Connection]]]) -> Never:
        """Note that drones came online, seldom enough that no drone drives booking; for ever."""
        while True:
            batch = await anext(connections)
            if self._online.note(batch, now=self._clock.wall_now()):
                self.note_change()
