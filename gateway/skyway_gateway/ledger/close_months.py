"""Closes months some days after their end, and notifies customers of their totals."""

import logging
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Final

from skyway.contracts.statement_event import ClosedTotal, StatementClosed, StatementData
from skyway.ids import EventId, SubjectId
from skyway.runtime.clock import FleetClock
from skyway.runtime.loops import Wake
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Database, Tx
from skyway.units import moment_to_ms, ms_to_moment
from skyway_gateway.ledger import store
from skyway_gateway.ledger.line import month_of
from skyway_gateway.notifications.event_store import add_statement_event

log = logging.getLogger(__name__)

#: A month is closed so long after its end, fleet time. Lines are written in the present month, so
#: no transaction is still writing lines of the month that is closed.
CLOSED_AFTER: Final = timedelta(days=3)


@dataclass(frozen=True, slots=True)
class MonthClosing:
    """Closes one month in each step; `wake` wakes the sender of webhooks."""

    db: Database
    clock: FleetClock
    mint: Mint
    wake: Wake

    async def step(self) -> bool:
        """Close the first month that is over and open; whether there may be another one."""
        at = ms_to_moment(moment_to_ms(self.clock.now()))
        async with self.db.read() as connection:
            before = month_of(at - CLOSED_AFTER)
            month = await store.month_to_close(connection, before=before)
        if month is None:
            return False
        async with self.db.write() as tx:
            if await store.close_month(tx, month, at=at):
                await self._notify(tx, month, at)
        log.info("month closed", extra={"month": month})
        return True

    async def _notify(self, tx: Tx, month: str, at: datetime) -> None:
        for customer_id, totals in (await store.totals_of_listeners(tx, month)).items():
            event = self._event(month, at, totals)
            await add_statement_event(
                tx, event, customer_id=SubjectId(customer_id), at=self.clock.wall_now()
            )
        tx.after_commit(self.wake.set)

    def _event(self, month: str, at: datetime, totals: list[ClosedTotal]) -> StatementClosed:
        return StatementClosed(
            message_id=self.mint("msg"),
            sent_at=at,
            event_id=EventId(self.mint("evt")),
            occurred_at=at,
            data=StatementData(month=month, closed_at=at, totals=tuple(totals)),
        )
