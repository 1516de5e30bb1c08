"""Messages that are repeated until their receiver confirms them, and no longer."""

from collections.abc import Sequence
from functools import lru_cache

from sqlalchemy import Delete, Table

from skyway.runtime.sql.among import among
from skyway.runtime.sql.database import Tx


async def confirm(tx: Tx, message_ids: Sequence[str]) -> int:
    """Stop repeating these messages; how many of them were still in the outbox."""
    if not message_ids:
        return 0
    found = await tx.execute(_confirming(tx.outbox_table()), {"message_ids": message_ids})
    return found.rowcount


@lru_cache(maxsize=10)  # making it takes longer than running it; a service has one outbox
def _confirming(outbox: Table) -> Delete:
    return outbox.delete().where(among(outbox.c.message_id, "message_ids"))
