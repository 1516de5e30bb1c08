"""The SQL of people's broker accounts: which are open, and which key gave them their password.

An account has one password at a time: that of the key for which it was opened last. When this key
ends, the account ends, too, although its holder may have other keys: who has stolen the key has its
password as well.
"""

from collections.abc import Sequence

from sqlalchemy import ColumnElement, and_, exists, or_, select, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.broker_rules import ACCOUNT_ROLES, AccountRole
from skyway.ids import KeyId, SubjectId
from skyway.runtime.sql.database import Tx
from skyway_gateway.access.api_key import KeyRole
from skyway_gateway.tables import api_keys


async def is_account_open(connection: AsyncConnection, key_id: KeyId) -> bool:
    """Whether the registry has the broker account that was issued with this key."""
    statement = select(api_keys.c.is_account_open).where(api_keys.c.key_id == key_id)
    return bool((await connection.execute(statement)).scalar())


async def has_password_of_other_key(
    connection: AsyncConnection, role: KeyRole, subject_id: SubjectId, *, key_id: KeyId
) -> bool:
    """Whether the subject's account has the password of another key that has not ended."""
    is_other = and_(
        _is_of(role, subject_id),
        api_keys.c.key_id != key_id,
        api_keys.c.gave_password,
        api_keys.c.deleted_wall_ms.is_(None),
    )
    return bool((await connection.execute(select(exists().where(is_other)))).scalar())


async def account_is_open(tx: Tx, role: KeyRole, subject_id: SubjectId, *, key_id: KeyId) -> None:
    """Note that the registry has the subject's account with the password of this key."""
    is_this = api_keys.c.key_id == key_id
    earlier = _is_of(role, subject_id) & api_keys.c.gave_password & ~is_this
    await tx.execute(update(api_keys).where(earlier).values(gave_password=False))
    values = {"is_account_open": True, "gave_password": True}
    await tx.execute(update(api_keys).where(is_this).values(values))


async def orphaned_accounts(
    connection: AsyncConnection,
) -> Sequence[tuple[AccountRole, SubjectId]]:
    """People whose account is open, though the key of its password or their last key has ended."""
    other = api_keys.alias("other")
    reads_own_events = (other.c.role == "customer") & other.c.scopes.contains('"deliveries:read"')
    has_key = exists().where(
        other.c.role == api_keys.c.role,
        other.c.subject_id == api_keys.c.subject_id,
        other.c.deleted_wall_ms.is_(None),
        or_(other.c.scopes.is_(None), reads_own_events),
    )
    is_orphaned = _has_open_account() & (api_keys.c.gave_password | ~has_key)
    columns = select(api_keys.c.role, api_keys.c.subject_id).distinct()
    rows = await connection.execute(columns.where(is_orphaned))
    return [(row.role, row.subject_id) for row in rows]


async def account_is_closed(tx: Tx, role: AccountRole, subject_id: SubjectId) -> None:
    """Note that the registry has closed somebody's broker account."""
    this = _has_open_account() & _is_of(role, subject_id)
    values = {"is_account_open": False, "gave_password": False}
    await tx.execute(update(api_keys).where(this).values(values))


def _is_of(role: KeyRole, subject_id: SubjectId) -> ColumnElement[bool]:
    return (api_keys.c.role == role) & (api_keys.c.subject_id == subject_id)


def _has_open_account() -> ColumnElement[bool]:
    return and_(
        api_keys.c.role.in_(ACCOUNT_ROLES),
        api_keys.c.is_account_open,
        api_keys.c.deleted_wall_ms.is_not(None),
    )
