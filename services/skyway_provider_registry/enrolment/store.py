"""All SQL of the broker's accounts."""

from collections.abc import Mapping

from sqlalchemy import delete, select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import DroneId, SubjectId
from skyway.runtime.database import Tx
from skyway_provider_registry.tables import broker_accounts


async def add_drones(tx: Tx, hashes: Mapping[DroneId, str]) -> None:
    """Open an account for each of these new drones."""
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


async def remove_drone(tx: Tx, drone_id: DroneId) -> None:
    """Close a drone's account."""
    await _remove(tx, "DRONE", drone_id)


async def remove_customer(tx: Tx, user_name: SubjectId) -> None:
    """Close a customer's account; nothing happens when there is none."""
    await _remove(tx, "CUSTOMER", user_name)


async def every_hash(connection: AsyncConnection) -> dict[str, str]:
    """User name to hash of every account."""
    columns = select(broker_accounts.c.user_name, broker_accounts.c.password_hash)
    return {row.user_name: row.password_hash for row in await connection.execute(columns)}


async def _remove(tx: Tx, kind: str, user_name: str) -> None:
    is_it = (broker_accounts.c.user_name == user_name) & (broker_accounts.c.kind == kind)
    await tx.execute(delete(broker_accounts).where(is_it))
