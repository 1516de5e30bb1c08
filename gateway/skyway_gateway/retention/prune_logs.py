"""Deletes old entries of the audit log, old attempts of webhooks, and what has expired."""

from dataclasses import dataclass
from datetime import timedelta
from typing import Final

from skyway.runtime.clock import FleetClock
from skyway.runtime.idempotency_store import sweep
from skyway.runtime.sql.database import Database
from skyway_gateway.access import session_link_store, session_store
from skyway_gateway.quotes import store as quote_store
from skyway_gateway.retention import log_store

#: How long a quote can be read after it has expired.
_QUOTES_KEPT: Final = timedelta(hours=24)


@dataclass(frozen=True, slots=True)
class LogPruning:
    """Deletes audit entries and webhook attempts after a span of wall time; None keeps them."""

    db: Database
    clock: FleetClock
    audit_kept: timedelta | None
    attempts_kept: timedelta | None

    async def step(self) -> bool:
        """Delete some of each; whether there may be more."""
        has_more = False
        for kept, delete in (
            (self.audit_kept, log_store.delete_entries),
            (self.attempts_kept, log_store.delete_attempts),
        ):
            if kept is not None:
                async with self.db.write() as tx:
                    has_more |= await delete(tx, before=self.clock.wall_now() - kept)
        return has_more


@dataclass(frozen=True, slots=True)
class ExpiredPruning:
    """Deletes what has expired: stored answers and quotes after a day, sessions, session links."""

    db: Database
    clock: FleetClock

    async def step(self) -> bool:
        """Delete all of it, some in each transaction; always False, for the next time."""
        await sweep(self.db, self.clock)
        now = self.clock.wall_now()
        has_more = True
        while has_more:
            async with self.db.write() as tx:
                has_more = await quote_store.delete_expired(tx, before=now - _QUOTES_KEPT)
        async with self.db.write() as tx:
            await session_store.delete_expired(tx, before=now)
            await session_link_store.delete_expired(tx, before=now)
        return False
