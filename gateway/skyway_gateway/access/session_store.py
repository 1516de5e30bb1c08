"""All SQL of the sessions of browsers."""

from dataclasses import replace
from datetime import datetime, timedelta
from typing import Final

from sqlalchemy import bindparam, delete, insert, select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import KeyId
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms, ms_to_moment
from skyway_gateway.access.store import StoredKey, shown_by_id
from skyway_gateway.tables import sessions

#: The sessions of one key; another one ends the oldest.
MOST_PER_KEY: Final = 50

_SESSION: Final = select(sessions.c.key_id, sessions.c.expires_wall_ms).where(
    sessions.c.session_hash == bindparam("session_hash")
)


async def add(tx: Tx, session_hash: str, key_id: KeyId, *, at: datetime, lasts: timedelta) -> None:
    """Add a session; the oldest one of the key ends if there are too many."""
    await tx.execute(
        insert(sessions).values(
            session_hash=session_hash, key_id=key_id, expires_wall_ms=moment_to_ms(at + lasts)
        )
    )
    of_key = (
        select(sessions.c.session_hash)
        .where(sessions.c.key_id == key_id)
        .order_by(sessions.c.expires_wall_ms.desc(), sessions.c.session_hash)
    )
    oldest = of_key.offset(MOST_PER_KEY)
    await tx.execute(delete(sessions).where(sessions.c.session_hash.in_(oldest)))


async def shown(connection: AsyncConnection, session_hash: str) -> StoredKey | None:
    """The key of a session, which ends with the session at the latest; None without a session."""
    row = (await connection.execute(_SESSION, {"session_hash": session_hash})).one_or_none()
    if row is None:
        return None
    key = await shown_by_id(connection, row.key_id)
    expires_at = ms_to_moment(row.expires_wall_ms)
    ends_at = expires_at if key.ends_at is None else min(key.ends_at, expires_at)
    holder = replace(key.holder, is_session=True)
    return replace(key, holder=holder, ends_at=ends_at, ends_first=None)


async def end(tx: Tx, session_hash: str) -> bool:
    """End a session; False when there is none."""
    done = await tx.execute(delete(sessions).where(sessions.c.session_hash == session_hash))
    return done.rowcount == 1


async def delete_expired(tx: Tx, *, before: datetime) -> None:
    """Delete the sessions that have expired."""
    await tx.execute(delete(sessions).where(sessions.c.expires_wall_ms < moment_to_ms(before)))
