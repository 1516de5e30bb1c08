"""Recognises API keys: the keys of people and providers, and the keys of drones.

A busy caller shows its key with each request, so a key is looked up once a second at most. A key
that this process deletes stops immediately; a key that another replica deletes stops within the
second.
"""

from datetime import timedelta
from typing import Final, Protocol

from skyway.ids import DroneId
from skyway.runtime.answer_cache import AnswerCache
from skyway.runtime.clock import FleetClock
from skyway.runtime.http.identity import Caller
from skyway.runtime.sql.database import Database
from skyway_gateway.access import store
from skyway_gateway.access.key import secret_hash

#: How long a caller is cached, wall time.
_KEPT: Final = timedelta(seconds=1)
_MOST_CACHED: Final = 10_000


class CachedKeys:
    """Recognises keys of customers, providers and operators; unknown keys are never cached."""

    def __init__(self, db: Database, clock: FleetClock) -> None:
        self._db = db
        self._cached = AnswerCache(self._look_up, clock=clock, kept=_KEPT, most=_MOST_CACHED)

    async def caller_of(self, secret: str) -> Caller | None:
        """The caller with this key; None when the key is unknown or deleted."""
        key_hash = secret_hash(secret)
        return self._cached.cached(key_hash) or await self._cached.ask(key_hash)

    def forget(self) -> None:
        """Empty the cache, because a key was deleted."""
        self._cached.clear()

    async def _look_up(self, key_hash: str) -> Caller | None:
        async with self._db.read() as connection:
            return await store.caller_of(connection, key_hash)


class DroneKeyRegistry(Protocol):
    """The registry, which issues the keys of drones."""

    async def drone_of(self, key_hash: str) -> DroneId | None:
        """The drone with this key; None when the key is unknown or no longer valid."""
        ...


class DroneKeys:
    """Recognises keys of drones; the registry is asked each time, so a revoked key stops."""

    def __init__(self, registry: DroneKeyRegistry) -> None:
        self._registry = registry

    async def caller_of(self, secret: str) -> Caller | None:
        """The drone that calls; None when the key is unknown or no longer valid."""
        drone_id = await self._registry.drone_of(secret_hash(secret))
        return None if drone_id is None else Caller("drone", drone_id)
