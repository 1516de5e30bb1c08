"""All SQL of the broker accounts."""

from collections.abc import Mapping
from datetime import datetime

from sqlalchemy import delete, select, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import DroneId, SubjectId
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms
from skyway_provider_registry.tables import broker_accounts


async def add_drones(tx: Tx, hashes: Mapping[DroneId, str]) -> None:
    """Open an account for each new drone."""
    rows = [
        {"user_name": drone_id, "kind": "DRONE", "password_hash": hashed}
        for drone_id, hashed in hashes.items()
    ]
    await tx.execute(broker_accounts.insert(), rows)


async def put_customer(tx: Tx, user_name: SubjectId, *, password_hash: str) -> None:
    """Open a customer's account, or give it another password."""
    statement = tx.insert(broker_accounts).values(
        user_name=user_name, kind="CUSTOMER", password_hash=password_hash
    )
    await tx.execute(
        statement.on_conflict_do_update(
            index_elements=["user_name"],
            set_={"password_hash": statement.excluded.password_hash},
            where=broker_accounts.c.kind == "CUSTOMER",
        )
    )


async def set_password(tx: Tx, drone_id: DroneId, *, password_hash: str) -> None:
    """Give a drone's account another password; this also opens a blocked account again."""
    is_account = (broker_accounts.c.user_name == drone_id) & (broker_accounts.c.kind == "DRONE")
    values = {"password_hash": password_hash, "revoked_wall_ms": None}
    await tx.execute(update(broker_accounts).where(is_account).values(values))


async def revoke(tx: Tx, drone_id: DroneId, *, at: datetime) -> None:
    """Block a drone's account until it gets another password."""
    is_account = (broker_accounts.c.user_name == drone_id) & (broker_accounts.c.kind == "DRONE")
    await tx.execute(
        update(broker_accounts).where(is_account).values(revoked_wall_ms=moment_to_ms(at))
    )


async def remove_drone(tx: Tx, drone_id: DroneId) -> None:
    """Close a drone's account."""
    await _remove(tx, "DRONE", drone_id)


async def remove_customer(tx: Tx, user_name: SubjectId) -> None:
    """Close a customer's account; nothing happens when there is none."""
    await _remove(tx, "CUSTOMER", user_name)


async def every_hash(connection: AsyncConnection) -> dict[str, str]:
    """The password hash of each account that may log in, by user name."""
    columns = select(broker_accounts.c.user_name, broker_accounts.c.password_hash).where(
        broker_accounts.c.revoked_wall_ms.is_(None)
    )
    return {row.user_name: row.password_hash for row in await connection.execute(columns)}


async def _remove(tx: Tx, kind: str, user_name: str) -> None:
    is_account = (broker_accounts.c.user_name == user_name) & (broker_accounts.c.kind == kind)
    await tx.execute(delete(broker_accounts).where(is_account))
