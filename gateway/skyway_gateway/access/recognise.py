"""Recognises the keys that requests show.

A busy caller shows its key with each request, so a key is looked up twice a second at most. A key
that this process deletes stops immediately; a key that another replica deletes stops within half a
second. A key with an expiry stops when its moment has come.
"""

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
from skyway_gateway.access import rotation_store, store
from skyway_gateway.access.keys_in_use import KeysInUse
from skyway_gateway.access.store import StoredKey, StoredLookUp

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
            await rotation_store.bring_into_force(tx, key_id, replaces=replaces, at=at)
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
