"""Recognising API keys: whose a key is, that a caller shows."""

from datetime import timedelta
from typing import Final, Protocol

from skyway.ids import DroneId
from skyway.runtime.clock import FleetClock
from skyway.runtime.http.identity import Caller
from skyway.runtime.remembered import Remembered
from skyway.runtime.sql.database import Database
from skyway_gateway.access import store
from skyway_gateway.access.key import secret_hash

#: How long a caller is believed unasked, wall time.
_KEPT: Final = timedelta(seconds=1)
_MOST_KNOWN: Final = 10_000


class KnownKeys:
    """Recognises keys; one that is not known is looked up each time."""

    def __init__(self, db: Database, clock: FleetClock) -> None:
        self._db = db
        self._known = Remembered(self._look_up, clock=clock, kept=_KEPT, most=_MOST_KNOWN)

    async def caller_of(self, secret: str) -> Caller | None:
        """Whose key this is; None when it is nobody's, or deleted."""
        key_hash = secret_hash(secret)
        return self._known.answer(key_hash) or await self._known.ask(key_hash)

    def forget(self) -> None:
        """Look every key up anew, for one was deleted."""
        self._known.forget()

    async def _look_up(self, key_hash: str) -> Caller | None:
        async with self._db.read() as connection:
            return await store.caller_of(connection, key_hash)


class DroneKeyRegistry(Protocol):
    """Where keys of drones are kept: the registry."""

    async def drone_of(self, key_hash: str) -> DroneId | None:
        """The drone whose key this is; None when it is nobody's, or not any more."""
        ...


class DroneKeys:
    """Recognises keys of drones."""

    def __init__(self, registry: DroneKeyRegistry) -> None:
        self._registry = registry

    async def caller_of(self, secret: str) -> Caller | None:
        """Whose key this is; None when it is nobody's, or not any more."""
        drone_id = await self._registry.drone_of(secret_hash(secret))
        return None if drone_id is None else Caller("drone", drone_id)
