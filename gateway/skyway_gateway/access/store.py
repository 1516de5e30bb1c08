"""The SQL of API keys and their rotations, and the condition for what belongs to a customer."""

import json
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Final

from pydantic import Field
from sqlalchemy import (
    Column,
    ColumnElement,
    and_,
    bindparam,
    case,
    exists,
    false,
    func,
    insert,
    or_,
    select,
    true,
    update,
)
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import TEST_PREFIX, KeyId, SubjectId, is_live_account
from skyway.runtime.errors import NotFound
from skyway.runtime.http.identity import Caller, KeyHolder
from skyway.runtime.http.paging import PageQuery
from skyway.runtime.sql.connection import AnyRow
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms, ms_to_moment
from skyway_gateway.access.api_key import ApiKey, KeyRole
from skyway_gateway.access.scopes import Scope
from skyway_gateway.delivery_tables import is_live_row
from skyway_gateway.tables import api_keys


@dataclass(frozen=True, slots=True)
class StoredKey:
    """A key as a request finds it: whose it is, and how it has ended or will end."""

    holder: KeyHolder
    is_deleted: bool
    ends_at: datetime | None
    #: The key that ends when this one is first used; None when that has happened.
    ends_first: KeyId | None


#: Finds the stored key of a hash.
StoredLookUp = Callable[[AsyncConnection, str], Awaitable[StoredKey | None]]

#: Finds the hashes in use that were made since a moment (ms of wall time), perhaps older ones too.
HashesInUse = Callable[[AsyncConnection, int], Awaitable[Sequence[str]]]

#: Run with each request, so they are built once.
_STORED: Final = select(
    api_keys.c.key_id,
    api_keys.c.role,
    api_keys.c.subject_id,
    api_keys.c.scopes,
    api_keys.c.expires_wall_ms,
    api_keys.c.ends_wall_ms,
    api_keys.c.deleted_wall_ms,
    api_keys.c.replaces_key_id,
    api_keys.c.is_next,
)
_SHOWN: Final = _STORED.where(api_keys.c.key_hash == bindparam("key_hash"))
_OF_SESSION: Final = _STORED.where(api_keys.c.key_id == bindparam("key_id"))


class KeyListQuery(PageQuery):
    """The query of the list of keys."""

    role: Annotated[KeyRole | None, Field(description="Only keys of this role.")] = None
    subject_id: Annotated[
        SubjectId | None, Field(description="Only keys of this customer, provider or operator.")
    ] = None


async def add(
    tx: Tx, key: ApiKey, *, key_hash: str, is_account_open: bool, is_next: bool = False
) -> None:
    """Add a new key; a next key ends the key that it replaces when it is first used."""
    await tx.execute(insert(api_keys).values(_row(key, key_hash, is_account_open, is_next)))


async def add_if_new(tx: Tx, key: ApiKey, *, key_hash: str) -> None:
    """Add a key with a given secret, unless it was added before, even if it is deleted now."""
    row = _row(key, key_hash, is_account_open=True, is_next=False)
    await tx.execute(tx.insert(api_keys).values(row).on_conflict_do_nothing())


async def shown(connection: AsyncConnection, key_hash: str) -> StoredKey | None:
    """The key that a request shows, even if it has ended; None when there never was one."""
    row = (await connection.execute(_SHOWN, {"key_hash": key_hash})).one_or_none()
    return None if row is None else _stored(row)


async def shown_by_id(connection: AsyncConnection, key_id: KeyId) -> StoredKey:
    """The key with this id, even if it has ended; keys are never removed."""
    return _stored((await connection.execute(_OF_SESSION, {"key_id": key_id})).one())


def _stored(row: AnyRow) -> StoredKey:
    holder = KeyHolder(
        caller=Caller(row.role, row.subject_id),
        key_id=row.key_id,
        scopes=None if row.scopes is None else frozenset(json.loads(row.scopes)),
        # A key that was rotated ends sooner than it expires, and gives no right beyond that.
        expires_at=_moment(row.ends_wall_ms),
    )
    ends_first = row.replaces_key_id if row.is_next else None
    return StoredKey(holder, row.deleted_wall_ms is not None, _moment(row.ends_wall_ms), ends_first)


async def hashes_in_use(connection: AsyncConnection, since_wall_ms: int) -> Sequence[str]:
    """The hashes of the keys that are not deleted and were made since then."""
    statement = select(api_keys.c.key_hash).where(
        api_keys.c.deleted_wall_ms.is_(None), api_keys.c.created_wall_ms >= since_wall_ms
    )
    return list((await connection.execute(statement)).scalars())


async def one(
    connection: AsyncConnection, caller: Caller, key_id: KeyId, *, at: datetime
) -> ApiKey:
    """A key that is in use.

    Raises
    ------
    NotFound
        There is no such key, or it is not the caller's.
    """
    statement = select(api_keys).where(
        api_keys.c.key_id == key_id, _is_in_use(at), _is_shown_to(caller)
    )
    row = (await connection.execute(statement)).one_or_none()
    if row is None:
        raise NotFound("key", key_id)
    return _key(row)


async def used(
    connection: AsyncConnection, role: KeyRole, subject_id: SubjectId, *, at: datetime
) -> int:
    """How many keys of a subject are in use; a key and its next key count as one."""
    statement = select(func.count()).where(
        api_keys.c.role == role,
        api_keys.c.subject_id == subject_id,
        ~api_keys.c.is_next,
        _is_in_use(at),
    )
    return int((await connection.execute(statement)).scalar_one())


async def page(
    connection: AsyncConnection, caller: Caller, query: KeyListQuery, *, at: datetime
) -> Sequence[ApiKey]:
    """Up to limit + 1 keys of the caller that are in use, sorted by id; operators see all keys."""
    statement = select(api_keys).where(_is_in_use(at), _is_shown_to(caller))
    if query.role is not None:
        statement = statement.where(api_keys.c.role == query.role)
    if query.subject_id is not None:
        statement = statement.where(api_keys.c.subject_id == query.subject_id)
    if (after := query.after_id()) is not None:
        statement = statement.where(api_keys.c.key_id > after)
    statement = statement.order_by(api_keys.c.key_id).limit(query.limit + 1)
    return [_key(row) for row in await connection.execute(statement)]


async def delete(tx: Tx, key_id: KeyId, *, at: datetime) -> None:
    """Delete a key and its next key: they stop with the next call.

    Raises
    ------
    NotFound
        There is no such key.
    """
    if not await _end(tx, api_keys.c.key_id == key_id, at):
        raise NotFound("key", key_id)
    await end_next(tx, key_id, at=at)


async def end_next(tx: Tx, key_id: KeyId, *, at: datetime) -> None:
    """Delete the next key of a key if it was not used yet."""
    await _end(tx, (api_keys.c.replaces_key_id == key_id) & api_keys.c.is_next, at)


async def end_expired(tx: Tx, *, at: datetime) -> None:
    """Mark the keys as deleted whose end has come: they stay ended if the clock is set back."""
    await _end(tx, api_keys.c.ends_wall_ms <= moment_to_ms(at), at)


async def has_expired(connection: AsyncConnection, *, at: datetime) -> bool:
    """Whether the end of a key has come that is not marked as deleted."""
    is_over = api_keys.c.deleted_wall_ms.is_(None) & (api_keys.c.ends_wall_ms <= moment_to_ms(at))
    return bool((await connection.execute(select(exists().where(is_over)))).scalar())


async def _end(tx: Tx, which: ColumnElement[bool], at: datetime) -> bool:
    """Mark keys as deleted; whether there were any."""
    statement = update(api_keys).where(which, api_keys.c.deleted_wall_ms.is_(None))
    ended = await tx.execute(statement.values(deleted_wall_ms=moment_to_ms(at)))
    return ended.rowcount > 0


def _is_shown_to(caller: Caller) -> ColumnElement[bool]:
    """Customers see their own keys, with a live key also those of their test account."""
    if caller.role == "operator":
        return true()
    accounts = [caller.subject_id]
    if is_live_account(caller.subject_id):
        accounts.append(TEST_PREFIX + caller.subject_id)
    return and_(api_keys.c.role == caller.role, api_keys.c.subject_id.in_(accounts))


def _is_in_use(at: datetime) -> ColumnElement[bool]:
    return and_(
        api_keys.c.deleted_wall_ms.is_(None),
        or_(api_keys.c.ends_wall_ms.is_(None), api_keys.c.ends_wall_ms > moment_to_ms(at)),
    )


def _row(key: ApiKey, key_hash: str, is_account_open: bool, is_next: bool) -> dict[str, object]:
    expires_ms = None if key.expires_wall_at is None else moment_to_ms(key.expires_wall_at)
    return {
        "key_id": key.key_id,
        "key_hash": key_hash,
        "role": key.role,
        "subject_id": key.subject_id,
        "name": key.name,
        "scopes": None if key.scopes is None else json.dumps(key.scopes),
        "created_wall_ms": moment_to_ms(key.created_wall_at),
        "expires_wall_ms": expires_ms,
        "ends_wall_ms": expires_ms,
        "replaces_key_id": key.replaces,
        "is_next": is_next,
        "is_account_open": is_account_open,
    }


def _key(row: AnyRow) -> ApiKey:
    return ApiKey(
        key_id=row.key_id,
        role=row.role,
        subject_id=row.subject_id,
        name=row.name,
        scopes=None if row.scopes is None else json.loads(row.scopes),
        created_wall_at=ms_to_moment(row.created_wall_ms),
        expires_wall_at=_moment(row.ends_wall_ms),
        replaces=row.replaces_key_id,
    )


def _moment(wall_ms: int | None) -> datetime | None:
    return None if wall_ms is None else ms_to_moment(wall_ms)


def owned(caller: Caller, customer_id: Column[str]) -> ColumnElement[bool]:
    """Whether a row belongs to the caller; operators see all live rows, providers none."""
    if caller.role == "operator":
        return is_live_row(customer_id)
    return customer_id == caller.subject_id if caller.role == "customer" else false()


@dataclass(frozen=True, slots=True)
class RotatedKey:
    """What a next key has of the key that it replaces."""

    name: str | None
    scopes: tuple[Scope, ...] | None
    expires_at: datetime | None
    is_account_open: bool


async def begin_rotation(
    tx: Tx, key_id: KeyId, *, at: datetime, until: datetime
) -> RotatedKey | None:
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
