"""API keys as operators see them, their SQL, and the condition for what belongs to a customer."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Final, Literal

from pydantic import Field
from sqlalchemy import (
    Column,
    ColumnElement,
    and_,
    bindparam,
    exists,
    false,
    func,
    insert,
    select,
    true,
    update,
)
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.bounds import Moment
from skyway.ids import KeyId, SubjectId
from skyway.json_model import JsonModel
from skyway.runtime.errors import NotFound
from skyway.runtime.http.identity import Caller
from skyway.runtime.http.paging import PageQuery
from skyway.runtime.sql.connection import AnyRow
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms, ms_to_moment
from skyway_gateway.tables import api_keys

KeyRole = Literal["customer", "provider", "operator"]


class NewKey(JsonModel):
    """The key to issue: its role, and the customer, provider or operator that it is for."""

    role: Annotated[KeyRole, Field(description="Who the key is for.")]
    subject_id: Annotated[
        SubjectId,
        Field(description="A customer's own name, a provider's id, or an operator's name."),
    ]


class ApiKey(JsonModel):
    """A key, without its secret."""

    key_id: Annotated[KeyId, Field(description="The id of the key, which is not secret.")]
    role: Annotated[KeyRole, Field(description="Who the key is for.")]
    subject_id: Annotated[
        SubjectId,
        Field(description="The customer's name, the provider's id or the operator's name."),
    ]
    created_at: Annotated[Moment, Field(description="RFC 3339 UTC, wall time")]


class BrokerLogin(JsonModel):
    """A broker account; each new key of a customer gives the same account a new password."""

    user_name: Annotated[str, Field(description="The user name at the broker.")]
    password: Annotated[
        str, Field(description="The password; a later key of the same customer replaces it.")
    ]


class IssuedKey(ApiKey):
    """A new key with its secrets, which are shown only once."""

    key: Annotated[
        str, Field(description="The secret key for `Authorization: Bearer`; it is shown only once.")
    ]
    mqtt: Annotated[
        BrokerLogin | None,
        Field(description="The broker account; null for providers, which have none."),
    ]


#: Runs with each request, so it is built once.
_CALLER: Final = select(api_keys.c.role, api_keys.c.subject_id).where(
    api_keys.c.key_hash == bindparam("key_hash"), api_keys.c.deleted_wall_ms.is_(None)
)


@dataclass(frozen=True, slots=True)
class KeyFilter:
    """Which keys a list shows."""

    role: KeyRole | None = None
    subject_id: SubjectId | None = None


async def add(tx: Tx, key: ApiKey, *, key_hash: str, is_account_open: bool) -> None:
    """Add a new key."""
    row = {
        "key_id": key.key_id,
        "key_hash": key_hash,
        "role": key.role,
        "subject_id": key.subject_id,
        "created_wall_ms": moment_to_ms(key.created_at),
        "is_account_open": is_account_open,
    }
    await tx.execute(insert(api_keys).values(row))


async def add_if_new(tx: Tx, key: ApiKey, *, key_hash: str) -> None:
    """Add a key with a given secret, unless it was added before, even if it is deleted now."""
    row = {
        "key_id": key.key_id,
        "key_hash": key_hash,
        "role": key.role,
        "subject_id": key.subject_id,
        "created_wall_ms": moment_to_ms(key.created_at),
        "is_account_open": True,
    }
    await tx.execute(tx.insert(api_keys).values(row).on_conflict_do_nothing())


async def caller_of(connection: AsyncConnection, key_hash: str) -> Caller | None:
    """The caller with this key; None when the key is unknown or deleted."""
    row = (await connection.execute(_CALLER, {"key_hash": key_hash})).one_or_none()
    return None if row is None else Caller(row.role, row.subject_id)


async def is_account_open(connection: AsyncConnection, key_id: KeyId) -> bool:
    """Whether the registry has the broker account that was issued with this key."""
    statement = select(api_keys.c.is_account_open).where(api_keys.c.key_id == key_id)
    return bool((await connection.execute(statement)).scalar())


async def account_is_open(tx: Tx, key_id: KeyId) -> None:
    """Note that the registry has the key's broker account."""
    this = api_keys.c.key_id == key_id
    await tx.execute(update(api_keys).where(this).values(is_account_open=True))


async def one(connection: AsyncConnection, key_id: KeyId) -> ApiKey:
    """A key that is not deleted.

    Raises
    ------
    NotFound
        There is no such key.
    """
    statement = select(api_keys).where(
        api_keys.c.key_id == key_id, api_keys.c.deleted_wall_ms.is_(None)
    )
    row = (await connection.execute(statement)).one_or_none()
    if row is None:
        raise NotFound("key", key_id)
    return _key(row)


async def used(connection: AsyncConnection, role: KeyRole, subject_id: SubjectId) -> int:
    """How many keys of a customer, provider or operator are not deleted."""
    statement = select(func.count()).where(
        api_keys.c.role == role,
        api_keys.c.subject_id == subject_id,
        api_keys.c.deleted_wall_ms.is_(None),
    )
    return int((await connection.execute(statement)).scalar_one())


async def page(
    connection: AsyncConnection, query: PageQuery, requested: KeyFilter
) -> Sequence[ApiKey]:
    """Up to limit + 1 keys that are not deleted, sorted by id."""
    statement = select(api_keys).where(api_keys.c.deleted_wall_ms.is_(None))
    if requested.role is not None:
        statement = statement.where(api_keys.c.role == requested.role)
    if requested.subject_id is not None:
        statement = statement.where(api_keys.c.subject_id == requested.subject_id)
    if (after := query.after(str)) is not None:
        statement = statement.where(api_keys.c.key_id > after[0])
    statement = statement.order_by(api_keys.c.key_id).limit(query.limit + 1)
    return [_key(row) for row in await connection.execute(statement)]


async def delete(tx: Tx, key_id: KeyId, *, at: datetime) -> None:
    """Delete a key: it stops with the next call.

    Raises
    ------
    NotFound
        There is no such key.
    """
    this = (api_keys.c.key_id == key_id) & api_keys.c.deleted_wall_ms.is_(None)
    deleted = {"deleted_wall_ms": moment_to_ms(at)}
    if (await tx.execute(update(api_keys).where(this).values(deleted))).rowcount == 0:
        raise NotFound("key", key_id)


async def orphaned_accounts(connection: AsyncConnection) -> Sequence[SubjectId]:
    """Customers without a key whose broker account is still open."""
    other = api_keys.alias("other")
    has_key = exists().where(
        other.c.role == "customer",
        other.c.subject_id == api_keys.c.subject_id,
        other.c.deleted_wall_ms.is_(None),
    )
    statement = select(api_keys.c.subject_id).distinct().where(_has_open_account(), ~has_key)
    return list((await connection.execute(statement)).scalars())


async def account_is_closed(tx: Tx, subject_id: SubjectId) -> None:
    """Note that the registry has closed a customer's broker account."""
    this = _has_open_account() & (api_keys.c.subject_id == subject_id)
    await tx.execute(update(api_keys).where(this).values(is_account_open=False))


def _has_open_account() -> ColumnElement[bool]:
    return and_(
        api_keys.c.role == "customer",
        api_keys.c.is_account_open,
        api_keys.c.deleted_wall_ms.is_not(None),
    )


def _key(row: AnyRow) -> ApiKey:
    return ApiKey(
        key_id=row.key_id,
        role=row.role,
        subject_id=row.subject_id,
        created_at=ms_to_moment(row.created_wall_ms),
    )


def owned(caller: Caller, customer_id: Column[str]) -> ColumnElement[bool]:
    """Whether a row belongs to the caller; operators see all rows, providers none."""
    if caller.role == "operator":
        return true()
    return customer_id == caller.subject_id if caller.role == "customer" else false()
