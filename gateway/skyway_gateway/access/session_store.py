"""All SQL of the sessions of browsers, and of the links that log a browser in once."""

from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime, timedelta
from typing import Final

from sqlalchemy import bindparam, delete, insert, select, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import KeyId
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms, ms_to_moment
from skyway_gateway.access.store import StoredKey, shown_by_id
from skyway_gateway.tables import session_links, sessions

#: How long a session lasts, wall time.
SESSION_LASTS: Final = timedelta(hours=12)

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


#: The links of one key; another one ends the oldest.
MOST_LINKS_PER_KEY: Final = 50

_LINK: Final = select(session_links).where(session_links.c.code_hash == bindparam("code_hash"))


async def add_link(tx: Tx, code_hash: str, key_id: KeyId, *, expires_at: datetime) -> None:
    """Add a link; the oldest one of the key ends if there are too many."""
    await tx.execute(
        insert(session_links).values(
            code_hash=code_hash, key_id=key_id, expires_wall_ms=moment_to_ms(expires_at)
        )
    )
    of_key = (
        select(session_links.c.code_hash)
        .where(session_links.c.key_id == key_id)
        .order_by(session_links.c.expires_wall_ms.desc(), session_links.c.code_hash)
    )
    oldest = of_key.offset(MOST_LINKS_PER_KEY)
    await tx.execute(delete(session_links).where(session_links.c.code_hash.in_(oldest)))


async def shown_by_link(connection: AsyncConnection, code_hash: str) -> StoredKey | None:
    """The key of a link, which ends when the link is used or expires; None without a link."""
    row = (await connection.execute(_LINK, {"code_hash": code_hash})).one_or_none()
    if row is None:
        return None
    key = await shown_by_id(connection, row.key_id)
    ended_ms = row.expires_wall_ms if row.used_wall_ms is None else row.used_wall_ms
    ends_at = ms_to_moment(ended_ms)
    return replace(
        key,
        ends_at=ends_at if key.ends_at is None else min(key.ends_at, ends_at),
        ends_first=None,
    )


async def use_link(tx: Tx, code_hash: str, *, at: datetime) -> bool:
    """Use a link; False if it was used or has expired. Of several who try, one gets True."""
    at_ms = moment_to_ms(at)
    statement = update(session_links).where(
        session_links.c.code_hash == code_hash,
        session_links.c.used_wall_ms.is_(None),
        session_links.c.expires_wall_ms > at_ms,
    )
    used = await tx.execute(statement.values(used_wall_ms=at_ms))
    return used.rowcount == 1


async def links_in_use(connection: AsyncConnection, since_wall_ms: int) -> Sequence[str]:
    """The hashes of the links that are not used and expire after this moment."""
    statement = select(session_links.c.code_hash).where(
        session_links.c.used_wall_ms.is_(None), session_links.c.expires_wall_ms >= since_wall_ms
    )
    return list((await connection.execute(statement)).scalars())


async def delete_expired_links(tx: Tx, *, before: datetime) -> None:
    """Delete the links that have expired."""
    is_over = session_links.c.expires_wall_ms < moment_to_ms(before)
    await tx.execute(delete(session_links).where(is_over))
