"""Deletes deliveries that ended long ago, at composition first and then here.

1. Deliveries are marked as leaving, and claimed for a while.
2. Composition deletes them, except those that it still needs.
3. They are deleted here.

After a kill between two of these, the claim runs out, and the marked deliveries are claimed again:
each part has the same effect when it is repeated. Two replicas claim different deliveries.
"""

import logging
from dataclasses import dataclass
from datetime import timedelta
from typing import Final

from skyway.contracts.forgotten_deliveries import ForgetDeliveries
from skyway.ids import DeliveryId
from skyway.runtime.clock import FleetClock
from skyway.runtime.sql.database import Database
from skyway_gateway.clients import Composition
from skyway_gateway.retention import delivery_store

log = logging.getLogger(__name__)

#: A delivery that composition still needs is tried again after this time, wall time.
_AGAIN_AFTER: Final = timedelta(hours=1)


@dataclass(frozen=True, slots=True)
class DeliveryPruning:
    """Deletes deliveries `kept` after their last change, a span of fleet time."""

    db: Database
    composition: Composition
    clock: FleetClock
    claimant: str
    kept: timedelta

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
        return await delivery_store.claim_old(
            self.db, before=before, claimant=self.claimant, clock=self.clock
        )

    async def forget(self, leaving: list[DeliveryId]) -> list[DeliveryId]:
        """Have composition delete them; those that it has deleted."""
        answer = await self.composition.forget(ForgetDeliveries(delivery_ids=tuple(leaving)))
        kept = frozenset(answer.kept)
        if kept:
            async with self.db.write() as tx:
                again = self.clock.wall_now() + _AGAIN_AFTER
                await delivery_store.keep(tx, kept, until=again)
        return [each for each in leaving if each not in kept]

    async def delete(self, forgotten: list[DeliveryId]) -> int:
        """Delete here what composition has deleted; how many deliveries."""
        if not forgotten:
            return 0
        async with self.db.write() as tx:
            return await delivery_store.delete_leaving(tx, forgotten)
