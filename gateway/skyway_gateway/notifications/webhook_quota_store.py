"""How many webhooks a customer may have."""

from collections.abc import Sequence
from dataclasses import dataclass

from sqlalchemy import func, select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import SubjectId
from skyway.runtime.errors import Conflict
from skyway.runtime.http.identity import Caller
from skyway.runtime.sql.database import Database, Tx
from skyway_gateway.access.usage import UsageQuota
from skyway_gateway.tables import webhooks


@dataclass(frozen=True, slots=True)
class WebhookQuota:
    """Refuses webhooks beyond the limit of their customer."""

    db: Database
    most: int

    async def refuse_too_many(self, tx: Tx, customer_id: SubjectId) -> None:
        """Go on only if the customer may have one more.

        Raises
        ------
        Conflict
            TOO_MANY_WEBHOOKS.
        """
        if await _used(tx.connection, customer_id) >= self.most:
            raise Conflict(
                "TOO_MANY_WEBHOOKS", f"the limit is {self.most} webhooks: delete one first"
            )

    async def usage(self, caller: Caller) -> Sequence[UsageQuota]:
        """How many webhooks the caller has."""
        if caller.role != "customer":
            return ()
        async with self.db.read() as connection:
            used = await _used(connection, SubjectId(caller.subject_id))
        return (UsageQuota(code="TOO_MANY_WEBHOOKS", most=self.most, used=used),)


async def _used(connection: AsyncConnection, customer_id: SubjectId) -> int:
    statement = select(func.count()).where(webhooks.c.customer_id == customer_id)
    return int((await connection.execute(statement)).scalar_one())
