"""Whose a shown key is, looked up once a second at most: a busy caller shows it with each request.

A key that is deleted here stops at once; one that another replica deletes stops within the second.
"""

from datetime import datetime, timedelta
from typing import Final

from skyway.runtime.clock import FleetClock
from skyway.runtime.database import Database
from skyway.runtime.identity import Caller
from skyway_gateway.access import store
from skyway_gateway.access.key import secret_hash

#: How long a caller is believed unasked, wall time.
_KEPT: Final = timedelta(seconds=1)
_MOST_KNOWN: Final = 10_000


class KnownKeys:
    """Recognises keys; one that is not known is looked up each time."""

    def __init__(self, db: Database, clock: FleetClock) -> None:
        self._db = db
        self._clock = clock
        self._known: dict[str, tuple[datetime, Caller]] = {}

    async def caller_of(self, secret: str) -> Caller | None:
        """Whose key this is; None when it is nobody's, or deleted."""
        key_hash, now = secret_hash(secret), self._clock.wall_now()
        looked_up_at, caller = self._known.get(key_hash, (now, None))
        if caller is not None and now - looked_up_at < _KEPT:
            return caller
        known = self._known  # replaced if a key is deleted meanwhile
        async with self._db.read() as connection:
            caller = await store.caller_of(connection, key_hash)
        if caller is None:
            known.pop(key_hash, None)
        else:
            if len(known) >= _MOST_KNOWN:
                known.clear()
            known[key_hash] = (now, caller)
        return caller

    def forget(self) -> None:
        """Look every key up anew, for one was deleted."""
        self._known = {}
