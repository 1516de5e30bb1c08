"""The keys in use, so that a wrong key is refused without a look at the database for each.

An address that shows wrong keys waits, and a caller with a right key behind the same address does
not. This holds for any number of wrong keys a second: all that come within a moment
share one read of the table.
"""

import asyncio
from datetime import timedelta
from typing import Final

from skyway.runtime.clock import FleetClock
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms
from skyway_gateway.access import store
from skyway_gateway.access.store import HashesInUse

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
