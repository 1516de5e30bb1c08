"""All SQL of the drones' keys.

A drone has one valid key, and after a rotation also a next key. The next key and the next password
become valid when the drone first uses the next key. Until then the old ones work: the drone may not
have the next ones, because the answer can be lost.
"""

from dataclasses import dataclass
from typing import Final

from sqlalchemy import BindParameter, bindparam, delete, or_, select, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import DroneId
from skyway.runtime.sql.database import Tx
from skyway_provider_registry.tables import broker_accounts, drone_keys

_HASH: Final[BindParameter[str]] = bindparam("key_hash")

#: Every call of a drone runs this statement, so it is built once.
_SHOWN: Final = select(
    drone_keys.c.drone_id, (drone_keys.c.key_hash != _HASH).label("is_next")
).where(or_(drone_keys.c.key_hash == _HASH, drone_keys.c.next_key_hash == _HASH))


@dataclass(frozen=True, slots=True)
class ShownKey:
    """The drone whose key was shown, and whether it is its next key."""

    drone_id: DroneId
    is_next: bool


async def put(tx: Tx, drone_id: DroneId, *, key_hash: str) -> None:
    """Give a drone this key; it is valid immediately and replaces all others."""
    row = {"drone_id": drone_id, "key_hash": key_hash}
    no_next = {"next_key_hash": None, "next_password_hash": None}
    statement = tx.insert(drone_keys).values(row | no_next)
    changed = {"key_hash": key_hash} | no_next
    await tx.execute(statement.on_conflict_do_update(index_elements=["drone_id"], set_=changed))


async def put_next(tx: Tx, drone_id: DroneId, *, key_hash: str, password_hash: str) -> bool:
    """Store the next key and password; False when the drone has no key."""
    statement = (
        update(drone_keys)
        .where(drone_keys.c.drone_id == drone_id)
        .values(next_key_hash=key_hash, next_password_hash=password_hash)
    )
    return (await tx.execute(statement)).rowcount == 1


async def shown(connection: AsyncConnection, key_hash: str) -> ShownKey | None:
    """The drone that has this key; None when there is none."""
    row = (await connection.execute(_SHOWN, {"key_hash": key_hash})).one_or_none()
    return None if row is None else ShownKey(DroneId(row.drone_id), bool(row.is_next))


async def bring_into_force(tx: Tx, key_hash: str) -> None:
    """Make the drone's next key and password valid; a second call changes nothing."""
    nexts = select(drone_keys.c.drone_id, drone_keys.c.next_password_hash).where(
        drone_keys.c.next_key_hash == key_hash
    )
    row = (await tx.execute(nexts.with_for_update())).one_or_none()
    if row is None:
        return
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


async def remove(tx: Tx, drone_id: DroneId) -> None:
    """Delete a drone's keys; nothing happens when there are none."""
    await tx.execute(delete(drone_keys).where(drone_keys.c.drone_id == drone_id))
