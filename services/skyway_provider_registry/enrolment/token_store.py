"""All SQL of the enrolment tokens: one per drone, the last that was made for it."""

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
    """Keep the tokens of drones that are new."""
    rows = [_row(drone_id, hashed, expires_at) for drone_id, hashed in hashes.items()]
    await tx.execute(enrolment_tokens.insert(), rows)


async def put(tx: Tx, drone_id: DroneId, *, token_hash: str, expires_at: datetime) -> None:
    """Keep a drone's token instead of the one before, which stops."""
    statement = tx.insert(enrolment_tokens).values(_row(drone_id, token_hash, expires_at))
    replaced = ("token_hash", "expires_wall_ms", "used_wall_ms")
    await tx.execute(
        statement.on_conflict_do_update(
            index_elements=["drone_id"],
            set_={name: statement.excluded[name] for name in replaced},
        )
    )


async def must_be_known(connection: AsyncConnection, token_hash: str) -> None:
    """Go on only with a token of a drone: what is made up must not occupy the database's writer.

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


async def take(tx: Tx, token_hash: str, *, at: datetime) -> DroneId:
    """Use a token up, and tell whose it is.

    Raises
    ------
    AccessDenied
        No drone has this token.
    Conflict
        It was used before, or is too old.
    """
    at_ms = moment_to_ms(at)
    is_it = enrolment_tokens.c.token_hash == token_hash
    is_good = enrolment_tokens.c.used_wall_ms.is_(None) & (
        enrolment_tokens.c.expires_wall_ms > at_ms
    )
    using = update(enrolment_tokens).where(is_it, is_good).values(used_wall_ms=at_ms)
    drone_id = (await tx.execute(using.returning(enrolment_tokens.c.drone_id))).scalar()
    if drone_id is not None:
        return DroneId(drone_id)
    used = (await tx.execute(select(enrolment_tokens.c.used_wall_ms).where(is_it))).one_or_none()
    if used is None:
        raise _unknown()
    if used.used_wall_ms is not None:
        raise Conflict("TOKEN_USED", "this enrolment token was used before")
    raise Conflict("TOKEN_EXPIRED", "this enrolment token is too old: have another one made")


async def remove(tx: Tx, drone_id: DroneId) -> None:
    """Stop a drone's token; nothing happens when there is none."""
    await tx.execute(delete(enrolment_tokens).where(enrolment_tokens.c.drone_id == drone_id))


def _unknown() -> AccessDenied:
    return AccessDenied("this enrolment token is not known, or another was made after it")


def _row(drone_id: DroneId, token_hash: str, expires_at: datetime) -> dict[str, object]:
    return {
        "drone_id": drone_id,
        "token_hash": token_hash,
        "expires_wall_ms": moment_to_ms(expires_at),
        "used_wall_ms": None,
    }
