"""All SQL of the enrolment tokens; each drone has at most one, the newest."""

from collections.abc import Mapping
from datetime import datetime

from sqlalchemy import delete, select, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import DroneId
from skyway.runtime.errors import AccessDenied, Conflict
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms
from skyway_provider_registry.tables import enrolment_tokens


async def add_new(tx: Tx, hashes: Mapping[DroneId, str], *, expires_at: datetime) -> None:
    """Store the tokens of new drones."""
    rows = [_row(drone_id, hashed, expires_at) for drone_id, hashed in hashes.items()]
    await tx.execute(enrolment_tokens.insert(), rows)


async def put(tx: Tx, drone_id: DroneId, *, token_hash: str, expires_at: datetime) -> None:
    """Store a drone's token; it replaces the previous token."""
    statement = tx.insert(enrolment_tokens).values(_row(drone_id, token_hash, expires_at))
    replaced = ("token_hash", "expires_wall_ms", "used_wall_ms")
    await tx.execute(
        statement.on_conflict_do_update(
            index_elements=["drone_id"],
            set_={name: statement.excluded[name] for name in replaced},
        )
    )


async def must_exist(connection: AsyncConnection, token_hash: str) -> None:
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
        raise _unknown()


async def use(tx: Tx, token_hash: str, *, at: datetime) -> DroneId:
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
        raise _unknown()
    if used.used_wall_ms is not None:
        raise Conflict("TOKEN_USED", "this enrolment token was used before")
    raise Conflict("TOKEN_EXPIRED", "this enrolment token is too old: request a new one")


async def remove(tx: Tx, drone_id: DroneId) -> None:
    """Delete a drone's token; nothing happens when there is none."""
    await tx.execute(delete(enrolment_tokens).where(enrolment_tokens.c.drone_id == drone_id))


def _unknown() -> AccessDenied:
    return AccessDenied("this enrolment token is unknown, or a newer one replaced it")


def _row(drone_id: DroneId, token_hash: str, expires_at: datetime) -> dict[str, object]:
    return {
        "drone_id": drone_id,
        "token_hash": token_hash,
        "expires_wall_ms": moment_to_ms(expires_at),
        "used_wall_ms": None,
    }
