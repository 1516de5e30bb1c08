"""Which rows other transactions have locked, on PostgreSQL."""

import asyncio
from typing import Any

from sqlalchemy import text


async def until_a_lock_is_waited_for(composition: Any) -> None:
    """Return once a transaction waits for a row that another transaction has locked."""
    async with asyncio.timeout(20):
        while not await composition.rows(
            "SELECT pid FROM pg_stat_activity "
            "WHERE datname = current_database() AND wait_event_type = 'Lock'"
        ):
            pass


async def free_keys(composition: Any, table: str, key: str) -> set[str]:
    """The keys of the rows of a table that nobody has locked."""
    async with composition.db.write() as tx:
        found = await tx.execute(text(f"SELECT {key} FROM {table} FOR UPDATE SKIP LOCKED"))
        return set(found.scalars())
