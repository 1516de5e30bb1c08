"""Whose a shown key is, looked up once a second at most: a busy caller shows it with each request.

A key that is deleted here stops at once; one that another replica deletes stops within the second.
"""

from datetime import timedelta
from typing import Final

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
