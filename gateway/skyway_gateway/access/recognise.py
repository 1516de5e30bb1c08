"""Recognises the keys that requests show.

A busy caller shows its key with each request, so a key is looked up twice a second at most. A key
that this process deletes stops immediately; a key that another replica deletes stops within half a
second. A key with an expiry stops when its moment has come.

A wrong key is refused without a look at the database for each. An address that shows wrong keys
waits, and a caller with a right key behind the same address does not. This holds for any number of
wrong keys a second: all that come within a moment share one read of the table.
"""

import asyncio
from datetime import timedelta
from typing import Final, Protocol

from skyway.contracts.drones import DRONE_KEY_PREFIX
from skyway.ids import DroneId, KeyId
from skyway.runtime.answer_cache import AnswerCache
from skyway.runtime.clock import FleetClock
from skyway.runtime.http.identity import Caller, KeyHolder, RefusedKey
from skyway.runtime.http.session_cookie import SESSION_PREFIX
from skyway.runtime.peer_secrets import secret_hash
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms
from skyway_gateway.access import store
from skyway_gateway.access.store import HashesInUse, StoredKey, StoredLookUp

#: Seconds of wall time between two reads.
_PAUSE_S: Final = 0.25

#: How long ended keys stay in memory, wall time: a key that is found here is looked up again.
_WHOLE_EVERY: Final = timedelta(seconds=60)

#: By how much the clocks of two replicas may differ, wall time.
_CLOCKS_DIFFER: Final = timedelta(minutes=5)

#: Hexadecimal digits of a hash that are kept: 64 bits are enough, and take 60 bytes a key.
_DIGITS: Final = 16


class KeysInUse:
    """Whether a key may be in use; a key that was made a moment ago is found, too."""

    def __init__(
        self,
        db: Database,
        clock: FleetClock,
        read: HashesInUse = store.hashes_in_use,
        *,
        pause_s: float = _PAUSE_S,
    ) -> None:
        self._db = db
        self._clock = clock
        self._read = read
        self._pause_s = pause_s
        self._hashes: set[int] = set()
        self._whole_at = clock.wall_now() - _WHOLE_EVERY
        self._next: asyncio.Task[None] | None = None

    async def may_hold(self, key_hash: str) -> bool:
        """False if no key in use has this hash (SHA-256, hexadecimal)."""
        short = _short(key_hash)
        if short not in self._hashes:
            await self._read_soon()
        return short in self._hashes

    def forget(self, key_hash: str) -> None:
        """Note that no key in use has this hash any more."""
        self._hashes.discard(_short(key_hash))

    async def _read_soon(self) -> None:
        """Wait for a read that begins after this call."""
        if self._next is None:
            self._next = asyncio.create_task(self._read_after_pause())
            self._next.add_done_callback(_ignore_error)
        await asyncio.shield(self._next)

    async def _read_after_pause(self) -> None:
        await asyncio.sleep(self._pause_s)
        # Who asks from now on waits for the next read: this one may not see their key.
        self._next = None
        now = self._clock.wall_now()
        is_whole = not timedelta() <= now - self._whole_at < _WHOLE_EVERY
        since_ms = 0 if is_whole else moment_to_ms(self._whole_at - _CLOCKS_DIFFER)
        async with self._db.read() as connection:
            hashes = await self._read(connection, since_ms)
        found = {_short(each) for each in hashes}
        if is_whole:
            self._hashes, self._whole_at = found, now
        else:
            self._hashes |= found


def _short(key_hash: str) -> int:
    return int(key_hash[:_DIGITS], 16)


def _ignore_error(done: asyncio.Task[None]) -> None:
    """Those who wait get the error; nobody may be left."""
    if not done.cancelled():
        done.exception()


#: How long a key is cached, wall time.
_KEPT: Final = timedelta(seconds=0.5)
_MOST_CACHED: Final = 10_000


class CachedKeys:
    """Recognises keys of customers, providers and operators; unknown keys are never cached.

    `look_up` finds a stored key by the hash of what is shown: of the key, or of a session of it.
    """

    def __init__(
        self, db: Database, clock: FleetClock, look_up: StoredLookUp = store.shown
    ) -> None:
        self._db = db
        self._clock = clock
        self._shown = look_up
        self._cached = AnswerCache(self._look_up, clock=clock, kept=_KEPT, most=_MOST_CACHED)

    async def recognise(self, secret: str) -> KeyHolder | RefusedKey:
        """The holder of this key, or why it is refused."""
        key_hash = secret_hash(secret)
        found = self._cached.cached(key_hash) or await self._cached.ask(key_hash)
        return self._judge(found)

    def forget(self) -> None:
        """Empty the cache, because a key has ended."""
        self._cached.clear()

    def _judge(self, found: StoredKey | None) -> KeyHolder | RefusedKey:
        if found is None:
            return RefusedKey("unknown")
        if found.is_deleted:
            return RefusedKey("revoked", found.holder)
        if found.ends_at is not None and found.ends_at <= self._clock.wall_now():
            return RefusedKey("expired", found.holder)
        return found.holder

    async def _look_up(self, key_hash: str) -> StoredKey | None:
        async with self._db.read() as connection:
            found = await self._shown(connection, key_hash)
        if found is None or found.ends_first is None or self._is_refused(found):
            return found
        await self._bring_into_force(KeyId(found.holder.key_id), found.ends_first)
        async with self._db.read() as connection:
            return await self._shown(connection, key_hash)

    def _is_refused(self, found: StoredKey) -> bool:
        return isinstance(self._judge(found), RefusedKey)

    async def _bring_into_force(self, key_id: KeyId, replaces: KeyId) -> None:
        async with self._db.write() as tx:
            at = self._clock.wall_now()
            await store.bring_into_force(tx, key_id, replaces=replaces, at=at)
            tx.after_commit(self.forget)


class DroneKeyRegistry(Protocol):
    """The registry, which issues the keys of drones."""

    async def drone_of(self, key_hash: str) -> DroneId | None:
        """The drone with this key; None when the key is unknown or no longer valid."""
        ...


class DroneKeys:
    """Recognises keys of drones; the registry is asked each time, so a revoked key stops."""

    def __init__(self, registry: DroneKeyRegistry) -> None:
        self._registry = registry

    async def recognise(self, secret: str) -> KeyHolder | RefusedKey:
        """The drone that calls, or that the key is unknown or no longer valid."""
        drone_id = await self._registry.drone_of(secret_hash(secret))
        if drone_id is None:
            return RefusedKey("unknown")
        return KeyHolder(Caller("drone", drone_id), key_id=drone_id)


class AllKeys:
    """The keys of all callers; how a key begins says whose it is."""

    def __init__(
        self, people: CachedKeys, sessions: CachedKeys, drones: DroneKeys, in_use: KeysInUse
    ) -> None:
        self._people = people
        self._sessions = sessions
        self._drones = drones
        self._in_use = in_use

    async def recognise(self, secret: str) -> KeyHolder | RefusedKey:
        """The holder of this key, or why it is refused."""
        if secret.startswith(DRONE_KEY_PREFIX):
            return await self._drones.recognise(secret)
        if secret.startswith(SESSION_PREFIX):
            return await self._sessions.recognise(secret)
        shown = await self._people.recognise(secret)
        if isinstance(shown, RefusedKey):
            # From now on an expired key is delayed like an unknown key.
            self._in_use.forget(secret_hash(secret))
        return shown

    async def may_be_in_use(self, secret: str) -> bool | None:
        """False for a key that is not in use; None for a drone's key and for a session."""
        if secret.startswith((DRONE_KEY_PREFIX, SESSION_PREFIX)):
            return None
        return await self._in_use.may_hold(secret_hash(secret))
