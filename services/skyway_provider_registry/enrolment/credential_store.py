"""All SQL of drones' credentials: broker accounts, keys and enrolment tokens.

A drone has one valid key, and after a rotation also a next key. The next key and the next password
become valid when the drone first uses the next key. Until then the old ones work: the drone may not
have the next ones, because the answer can be lost.

Each drone has at most one enrolment token, the newest. Customers and operators have broker
accounts, too.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Final, Literal

from sqlalchemy import BindParameter, Column, bindparam, delete, or_, select, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.broker_setup.certificates import CLIENT_LIFE
from skyway.contracts.broker_rules import drone_account
from skyway.ids import DroneId
from skyway.runtime.errors import AccessDenied, Conflict
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms
from skyway_provider_registry import change_store
from skyway_provider_registry.change_store import RenewalMoment
from skyway_provider_registry.enrolment import signing_store
from skyway_provider_registry.tables import (
    broker_accounts,
    drone_keys,
    drones,
    enrolment_tokens,
    revoked_certificates,
)

#: People with broker accounts.
PersonKind = Literal["CUSTOMER", "OPERATOR"]

_KEY_HASH: Final[BindParameter[str]] = bindparam("key_hash")

#: Every call of a drone runs this statement, so it is built once.
_SHOWN_KEY: Final = select(
    drone_keys.c.drone_id, (drone_keys.c.key_hash != _KEY_HASH).label("is_next")
).where(or_(drone_keys.c.key_hash == _KEY_HASH, drone_keys.c.next_key_hash == _KEY_HASH))


async def add_accounts(tx: Tx, hashes: Mapping[DroneId, str]) -> None:
    """Open an account for each new drone."""
    rows = [
        {"user_name": drone_id, "kind": "DRONE", "password_hash": hashed}
        for drone_id, hashed in hashes.items()
    ]
    await tx.execute(broker_accounts.insert(), rows)


async def put_person(tx: Tx, kind: PersonKind, user_name: str, *, password_hash: str) -> None:
    """Open a customer's or an operator's account, or give it another password."""
    statement = tx.insert(broker_accounts).values(
        user_name=user_name, kind=kind, password_hash=password_hash
    )
    await tx.execute(
        statement.on_conflict_do_update(
            index_elements=["user_name"],
            set_={"password_hash": statement.excluded.password_hash},
            where=broker_accounts.c.kind == kind,
        )
    )


async def set_password(tx: Tx, drone_id: DroneId, *, password_hash: str) -> None:
    """Give a drone's account another password; this also opens a blocked account again."""
    is_account = (broker_accounts.c.user_name == drone_id) & (broker_accounts.c.kind == "DRONE")
    values = {"password_hash": password_hash, "revoked_wall_ms": None}
    await tx.execute(update(broker_accounts).where(is_account).values(values))


async def block_account(tx: Tx, drone_id: DroneId, *, at: datetime) -> None:
    """Block a drone's account until it gets another password."""
    is_account = (broker_accounts.c.user_name == drone_id) & (broker_accounts.c.kind == "DRONE")
    await tx.execute(
        update(broker_accounts).where(is_account).values(revoked_wall_ms=moment_to_ms(at))
    )


async def remove_account(tx: Tx, drone_id: DroneId) -> None:
    """Close a drone's account."""
    await _remove_account(tx, "DRONE", drone_id)


async def remove_person(tx: Tx, kind: PersonKind, user_name: str) -> None:
    """Close a customer's or an operator's account; nothing happens when there is none."""
    await _remove_account(tx, kind, user_name)


async def every_hash(connection: AsyncConnection) -> dict[str, str]:
    """The password hash of each account that may log in, by its user name at the broker."""
    of_drones = (
        select(broker_accounts.c.password_hash, drones.c.provider_id, drones.c.drone_id)
        .join(drones, drones.c.drone_id == broker_accounts.c.user_name)
        .where(broker_accounts.c.revoked_wall_ms.is_(None), broker_accounts.c.kind == "DRONE")
    )
    of_people = select(broker_accounts.c.password_hash, broker_accounts.c.user_name).where(
        broker_accounts.c.revoked_wall_ms.is_(None), broker_accounts.c.kind != "DRONE"
    )
    hashes = {
        drone_account(row.provider_id, row.drone_id): row.password_hash
        for row in await connection.execute(of_drones)
    }
    people = await connection.execute(of_people)
    return hashes | {row.user_name: row.password_hash for row in people}


async def _remove_account(tx: Tx, kind: str, user_name: str) -> None:
    is_account = (broker_accounts.c.user_name == user_name) & (broker_accounts.c.kind == kind)
    await tx.execute(delete(broker_accounts).where(is_account))


@dataclass(frozen=True, slots=True)
class ShownKey:
    """The drone whose key was shown, and whether it is its next key."""

    drone_id: DroneId
    is_next: bool


async def put_key(tx: Tx, drone_id: DroneId, *, key_hash: str, at: datetime) -> None:
    """Give a drone this key; it is valid immediately and replaces all others."""
    await _revoke(tx, drone_id, drone_keys.c.key_hash, drone_keys.c.next_key_hash, at=at)
    row = {"drone_id": drone_id, "key_hash": key_hash}
    no_next = {"next_key_hash": None, "next_password_hash": None}
    statement = tx.insert(drone_keys).values(row | no_next)
    changed = {"key_hash": key_hash} | no_next
    await tx.execute(statement.on_conflict_do_update(index_elements=["drone_id"], set_=changed))


async def put_next_key(
    tx: Tx, drone_id: DroneId, *, key_hash: str, password_hash: str, at: datetime
) -> bool:
    """Store the next key and password; False when the drone has no key."""
    await _revoke(tx, drone_id, drone_keys.c.next_key_hash, at=at)
    statement = (
        update(drone_keys)
        .where(drone_keys.c.drone_id == drone_id)
        .values(next_key_hash=key_hash, next_password_hash=password_hash)
    )
    return (await tx.execute(statement)).rowcount == 1


async def shown_key(connection: AsyncConnection, key_hash: str) -> ShownKey | None:
    """The drone that has this key; None when there is none."""
    row = (await connection.execute(_SHOWN_KEY, {"key_hash": key_hash})).one_or_none()
    return None if row is None else ShownKey(DroneId(row.drone_id), bool(row.is_next))


async def bring_into_force(tx: Tx, key_hash: str, moment: RenewalMoment) -> None:
    """Make the drone's next key and password valid; a second call changes nothing."""
    nexts = select(drone_keys.c.drone_id, drone_keys.c.next_password_hash).where(
        drone_keys.c.next_key_hash == key_hash
    )
    row = (await tx.execute(nexts.with_for_update())).one_or_none()
    if row is None:
        return
    await _revoke(tx, DroneId(row.drone_id), drone_keys.c.key_hash, at=moment.wall_at)
    await tx.execute(
        update(drone_keys)
        .where(drone_keys.c.drone_id == row.drone_id)
        .values(key_hash=key_hash, next_key_hash=None, next_password_hash=None)
    )
    await tx.execute(
        update(broker_accounts)
        .where(broker_accounts.c.user_name == row.drone_id, broker_accounts.c.kind == "DRONE")
        .values(password_hash=row.next_password_hash)
    )
    await signing_store.bring_into_force(tx, DroneId(row.drone_id))
    await change_store.note(tx, DroneId(row.drone_id), moment)


async def remove_keys(tx: Tx, drone_id: DroneId, *, at: datetime) -> None:
    """Delete a drone's keys; nothing happens when there are none."""
    await _revoke(tx, drone_id, drone_keys.c.key_hash, drone_keys.c.next_key_hash, at=at)
    await tx.execute(delete(drone_keys).where(drone_keys.c.drone_id == drone_id))


async def revoked_keys(connection: AsyncConnection) -> dict[str, str]:
    """The hashes of keys whose certificate is revoked, each with the drone's user name."""
    columns = revoked_certificates.c
    rows = await connection.execute(select(columns.key_hash, columns.user_name))
    return {row.key_hash: row.user_name for row in rows}


async def _revoke(tx: Tx, drone_id: DroneId, *which: Column[str], at: datetime) -> None:
    """Revoke the certificates that came with these keys of a drone, for as long as they last."""
    now_ms, ends_ms = moment_to_ms(at), moment_to_ms(at + CLIENT_LIFE)
    is_over = revoked_certificates.c.ends_wall_ms < now_ms
    await tx.execute(delete(revoked_certificates).where(is_over))
    keys = select(drones.c.provider_id, *which).join(drone_keys)
    row = (await tx.execute(keys.where(drones.c.drone_id == drone_id))).one_or_none()
    if row is None:
        return
    provider_id, *key_hashes = row
    account = drone_account(provider_id, drone_id)
    rows = [
        {"key_hash": key_hash, "user_name": account, "ends_wall_ms": ends_ms}
        for key_hash in key_hashes
        if key_hash is not None
    ]
    if rows:
        await tx.execute(tx.insert(revoked_certificates).values(rows).on_conflict_do_nothing())


async def add_tokens(tx: Tx, hashes: Mapping[DroneId, str], *, expires_at: datetime) -> None:
    """Store the tokens of new drones."""
    rows = [_token_row(drone_id, hashed, expires_at) for drone_id, hashed in hashes.items()]
    await tx.execute(enrolment_tokens.insert(), rows)


async def put_token(tx: Tx, drone_id: DroneId, *, token_hash: str, expires_at: datetime) -> None:
    """Store a drone's token; it replaces the previous token."""
    statement = tx.insert(enrolment_tokens).values(_token_row(drone_id, token_hash, expires_at))
    replaced = ("token_hash", "expires_wall_ms", "used_wall_ms")
    await tx.execute(
        statement.on_conflict_do_update(
            index_elements=["drone_id"],
            set_={name: statement.excluded[name] for name in replaced},
        )
    )


async def require_token(connection: AsyncConnection, token_hash: str) -> None:
    """Refuse a token that no drone has, before an invented token occupies the database's writer.

    Raises
    ------
    AccessDenied
        No drone has this token.
    """
    statement = select(enrolment_tokens.c.drone_id).where(
        enrolment_tokens.c.token_hash == token_hash
    )
    if (await connection.execute(statement)).one_or_none() is None:
        raise _unknown_token()


async def use_token(tx: Tx, token_hash: str, *, at: datetime) -> DroneId:
    """Mark a token as used; the result is the drone that has it.

    Raises
    ------
    AccessDenied
        No drone has this token.
    Conflict
        The token was used before or is too old.
    """
    at_ms = moment_to_ms(at)
    has_token = enrolment_tokens.c.token_hash == token_hash
    is_valid = enrolment_tokens.c.used_wall_ms.is_(None) & (
        enrolment_tokens.c.expires_wall_ms > at_ms
    )
    using = update(enrolment_tokens).where(has_token, is_valid).values(used_wall_ms=at_ms)
    drone_id = (await tx.execute(using.returning(enrolment_tokens.c.drone_id))).scalar()
    if drone_id is not None:
        return DroneId(drone_id)
    used = (
        await tx.execute(select(enrolment_tokens.c.used_wall_ms).where(has_token))
    ).one_or_none()
    if used is None:
        raise _unknown_token()
    if used.used_wall_ms is not None:
        raise Conflict("TOKEN_USED", "this enrolment token was used before")
    raise Conflict("TOKEN_EXPIRED", "this enrolment token is too old: request a new one")


async def remove_token(tx: Tx, drone_id: DroneId) -> None:
    """Delete a drone's token; nothing happens when there is none."""
    await tx.execute(delete(enrolment_tokens).where(enrolment_tokens.c.drone_id == drone_id))


def _unknown_token() -> AccessDenied:
    return AccessDenied("this enrolment token is unknown, or a newer one replaced it")


def _token_row(drone_id: DroneId, token_hash: str, expires_at: datetime) -> dict[str, object]:
    return {
        "drone_id": drone_id,
        "token_hash": token_hash,
        "expires_wall_ms": moment_to_ms(expires_at),
        "used_wall_ms": None,
    }
