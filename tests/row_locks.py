"""Which rows transactions have locked, and which transactions wait for them, on PostgreSQL."""

import asyncio

from sqlalchemy import text

from skyway.runtime.sql.database import Database

_WAITING = text(
    "SELECT pid FROM pg_stat_activity "
    "WHERE datname = current_database() AND wait_event_type = 'Lock'"
)


async def until_a_lock_is_waited_for(db: Database) -> None:
    """Return once a transaction waits for a row that another transaction has locked."""
    async with asyncio.timeout(60):
        while True:
            async with db.read() as connection:
                if (await connection.execute(_WAITING)).first() is not None:
                    return


async def free_keys(db: Database, table: str, key: str) -> set[str]:
    """The keys of the rows of a table that nobody has locked."""
    async with db.write() as tx:
        found = await tx.execute(text(f"SELECT {key} FROM {table} FOR UPDATE SKIP LOCKED"))
        return set(found.scalars())
