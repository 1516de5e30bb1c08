"""The SQL of rotations of API keys: the next key, and its first use."""

import json
from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import case, or_, select, update

from skyway.ids import KeyId
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms, ms_to_moment
from skyway_gateway.access.scopes import Scope
from skyway_gateway.access.store import end_next
from skyway_gateway.tables import api_keys


@dataclass(frozen=True, slots=True)
class RotatedKey:
    """What a next key has of the key that it replaces."""

    name: str | None
    scopes: tuple[Scope, ...] | None
    expires_at: datetime | None
    is_account_open: bool


async def begin(tx: Tx, key_id: KeyId, *, at: datetime, until: datetime) -> RotatedKey | None:
    """Have a key end at `until`, if not sooner, and delete its earlier next key.

    None when the key has ended. A second rotation does not move the end.
    """
    ends, until_ms = api_keys.c.ends_wall_ms, moment_to_ms(until)
    earlier = case((or_(ends.is_(None), ends > until_ms), until_ms), else_=ends)
    this = (api_keys.c.key_id == key_id) & api_keys.c.deleted_wall_ms.is_(None)
    # First of all, so that two rotations of the same key wait for each other here.
    ending = update(api_keys).where(this).values(ends_wall_ms=earlier)
    if (await tx.execute(ending)).rowcount == 0:
        return None
    await end_next(tx, key_id, at=at)
    row = (await tx.execute(select(api_keys).where(this))).one()
    expires_at = None if row.expires_wall_ms is None else ms_to_moment(row.expires_wall_ms)
    scopes = None if row.scopes is None else tuple(json.loads(row.scopes))
    return RotatedKey(row.name, scopes, expires_at, row.is_account_open)


async def bring_into_force(tx: Tx, key_id: KeyId, *, replaces: KeyId, at: datetime) -> None:
    """End the key that a next key replaces; a second call changes nothing.

    The replaced key comes first, as in a deletion: they wait for each other, and neither deadlocks.
    """
    replaced = (api_keys.c.key_id == replaces) & api_keys.c.deleted_wall_ms.is_(None)
    at_ms = moment_to_ms(at)
    await tx.execute(update(api_keys).where(replaced).values(deleted_wall_ms=at_ms))
    is_next = (api_keys.c.key_id == key_id) & api_keys.c.is_next
    in_use = is_next & api_keys.c.deleted_wall_ms.is_(None)
    await tx.execute(update(api_keys).where(in_use).values(is_next=False))
