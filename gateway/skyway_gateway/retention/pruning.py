"""Deletes what is older than the settings keep: the steps, and the loops that run them.

Personal data is erased long before its delivery is deleted.

A delivery that ended long ago is deleted at composition first and then here:

1. Deliveries are marked as leaving, and claimed for a while.
2. Composition deletes them, except those that it still needs.
3. They are deleted here.

After a kill between two of these, the claim runs out, and the marked deliveries are claimed again:
each part has the same effect when it is repeated. Two replicas claim different deliveries.
"""

import logging
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from datetime import timedelta
from typing import Final

from skyway.contracts.forgotten_deliveries import ForgetDeliveries
from skyway.ids import DeliveryId
from skyway.runtime.clock import FleetClock
from skyway.runtime.idempotency_store import sweep
from skyway.runtime.loops import Loops, repeat
from skyway.runtime.sql.claims import Claiming
from skyway.runtime.sql.database import Database
from skyway_gateway.access import session_store
from skyway_gateway.clients import DeliveryComposition
from skyway_gateway.deliveries.proving.photos import Photos
from skyway_gateway.personal_data import store as personal_data_store
from skyway_gateway.quotes import store as quote_store
from skyway_gateway.retention import store
from skyway_gateway.settings import GatewaySettings

log = logging.getLogger(__name__)

#: A delivery that composition still needs is tried again after this time, wall time.
_AGAIN_AFTER: Final = timedelta(hours=1)

#: How long test deliveries are kept after their end, fleet time; never longer than others.
_TESTS_KEPT: Final = timedelta(days=7)


@dataclass(frozen=True, slots=True)
class DeliveryPruning:
    """Deletes deliveries `kept` after their last change, a span of fleet time."""

    db: Database
    composition: DeliveryComposition
    clock: FleetClock
    claimant: str
    kept: timedelta
    photos: Photos
    which: Claiming = store.OF_ALL

    async def step(self) -> bool:
        """Delete some deliveries; always False, so that a long backlog leaves time for others."""
        leaving = await self.mark()
        if leaving:
            forgotten = await self.forget(leaving)
            deleted = await self.delete(forgotten)
            log.info("old deliveries deleted", extra={"deliveries": deleted})
        return False

    async def mark(self) -> list[DeliveryId]:
        """Claim deliveries that ended long ago, and mark them as leaving."""
        before = self.clock.now() - self.kept
        return await store.claim_old(
            self.db, self.which, before=before, claimant=self.claimant, clock=self.clock
        )

    async def forget(self, leaving: list[DeliveryId]) -> list[DeliveryId]:
        """Have composition delete them; those that it has deleted."""
        answer = await self.composition.forget(ForgetDeliveries(delivery_ids=tuple(leaving)))
        kept = frozenset(answer.kept)
        if kept:
            async with self.db.write() as tx:
                again = self.clock.wall_now() + _AGAIN_AFTER
                await store.keep(tx, kept, until=again)
        return [each for each in leaving if each not in kept]

    async def delete(self, forgotten: list[DeliveryId]) -> int:
        """Delete here what composition has deleted; how many deliveries."""
        if not forgotten:
            return 0
        await self.photos.erase_of(forgotten)
        async with self.db.write() as tx:
            return await store.delete_leaving(tx, forgotten)


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
            (self.audit_kept, store.delete_entries),
            (self.attempts_kept, store.delete_attempts),
        ):
            if kept is not None:
                async with self.db.write() as tx:
                    has_more |= await delete(tx, before=self.clock.wall_now() - kept)
        return has_more


@dataclass(frozen=True, slots=True)
class PersonalDataPruning:
    """Erases the personal data of deliveries so long after their end as was promised."""

    db: Database
    clock: FleetClock

    async def step(self) -> bool:
        """Erase some; whether there may be more."""
        async with self.db.write() as tx:
            erased = await personal_data_store.erase_old(tx, at=self.clock.now())
        return erased == personal_data_store.BATCH


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
            await session_store.delete_expired_links(tx, before=now)
        return False


#: Seconds of wall time between two steps. A step deletes 200 deliveries, so 100 a second end.
_DELIVERIES_EVERY_S: Final = 2.0
_LOGS_EVERY_S: Final = 60.0
_PERSONAL_EVERY_S: Final = 60.0
_EXPIRED_EVERY_S: Final = 600.0

#: A step of a loop.
Step = Callable[[], Awaitable[bool]]


def start_pruning(
    loops: Loops,
    db: Database,
    clock: FleetClock,
    *,
    composition: DeliveryComposition,
    claimant: str,
    settings: GatewaySettings,
    photos: Photos,
    led: Callable[[Step], Step],
) -> None:
    """Start to delete what is older than the settings keep; `led` makes a step the leader's."""
    personal = led(PersonalDataPruning(db, clock).step)
    loops.start("personal data", repeat("personal data", personal, every_s=_PERSONAL_EVERY_S))
    pictures = led(photos.erase_due)
    loops.start("proofs", repeat("proofs", pictures, every_s=_PERSONAL_EVERY_S))
    expired = ExpiredPruning(db, clock)
    loops.start("sweep", repeat("sweep", led(expired.step), every_s=_EXPIRED_EVERY_S))
    tests = DeliveryPruning(
        db,
        composition,
        clock,
        claimant=claimant,
        kept=_TESTS_KEPT,
        photos=photos,
        which=store.OF_TEST_ACCOUNTS,
    )
    old_tests = repeat("old test deliveries", led(tests.step), every_s=_DELIVERIES_EVERY_S)
    loops.start("old test deliveries", old_tests)
    if settings.delivery_days is not None:
        deliveries = DeliveryPruning(
            db,
            composition,
            clock,
            claimant=claimant,
            kept=timedelta(days=settings.delivery_days),
            photos=photos,
        )
        step = repeat("old deliveries", led(deliveries.step), every_s=_DELIVERIES_EVERY_S)
        loops.start("old deliveries", step)
    logs = LogPruning(
        db,
        clock,
        audit_kept=_span(settings.audit_days),
        attempts_kept=_span(settings.webhook_attempt_days),
    )
    loops.start("old logs", repeat("old logs", led(logs.step), every_s=_LOGS_EVERY_S))


def _span(days: float | None) -> timedelta | None:
    return None if days is None else timedelta(days=days)
