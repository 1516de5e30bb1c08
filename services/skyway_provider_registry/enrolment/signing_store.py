"""The keys with which drones sign their messages, and all their SQL."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Final

from pydantic import AfterValidator, Field
from sqlalchemy import Text, bindparam, exists, false, func, or_, select, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.drones import DroneSignature
from skyway.contracts.signature import PublicKey
from skyway.errors import InvalidInput
from skyway.ids import DroneId
from skyway.runtime.clock import FleetClock
from skyway.runtime.signing.key_book import CHANGES_NAMED_FOR
from skyway.runtime.signing.key_pair import public_key_bytes
from skyway.runtime.sql.connection import AnyRow
from skyway.runtime.sql.database import Database, Tx
from skyway.runtime.sql.in_list import in_list
from skyway.units import moment_to_ms
from skyway_provider_registry.tables import drone_signing_keys, drones, renewals

_SIGNATURES: Final = select(
    drones.c.drone_id,
    drones.c.network_id,
    # A drone that has signed is believed only with a signature, even if the row of its key is lost.
    or_(drones.c.is_signing, func.coalesce(drone_signing_keys.c.is_required, false())).label(
        "is_required"
    ),
    drone_signing_keys.c.public_key,
).select_from(drones.outerjoin(drone_signing_keys))

# Built once: every batch of messages of unknown drones runs the first one, and every process the
# second one each second.
_OF: Final = _SIGNATURES.where(in_list(drones.c.drone_id, "drone_ids"))
_CHANGED: Final = _SIGNATURES.join(renewals, renewals.c.drone_id == drones.c.drone_id).where(
    renewals.c.renewed_wall_ms >= bindparam("since_wall_ms")
)

_is_of_drone: Final = drone_signing_keys.c.drone_id == bindparam("of_drone", type_=Text)
_REQUIRED: Final = select(drones.c.drone_id).where(
    drones.c.drone_id == bindparam("of_drone", type_=Text),
    or_(drones.c.is_signing, exists().where(_is_of_drone, drone_signing_keys.c.is_required)),
)
_NOTE_SIGNING: Final = (
    update(drones)
    .where(
        drones.c.drone_id == bindparam("of_drone", type_=Text),
        exists().where(_is_of_drone, drone_signing_keys.c.is_required),
    )
    .values(is_signing=True)
)
_REVOKE: Final = (
    update(drone_signing_keys).where(_is_of_drone).values(public_key=None, next_public_key=None)
)
_FOLLOW: Final = (
    update(drone_signing_keys)
    .where(_is_of_drone, drone_signing_keys.c.next_public_key.is_not(None))
    .values(is_required=True, public_key=drone_signing_keys.c.next_public_key, next_public_key=None)
)


async def signatures_of(
    connection: AsyncConnection, drone_ids: Collection[DroneId]
) -> list[DroneSignature]:
    """How each of these drones signs; one that is not registered is left out."""
    found = await connection.execute(_OF, {"drone_ids": sorted(drone_ids)})
    return [_signature(row) for row in found]


async def changed_since(
    connection: AsyncConnection, *, since_wall_at: datetime
) -> list[DroneSignature]:
    """How the drones sign whose credentials were renewed since this moment of wall time."""
    found = await connection.execute(_CHANGED, {"since_wall_ms": moment_to_ms(since_wall_at)})
    return [_signature(row) for row in found]


async def add_keys(tx: Tx, public_keys: Mapping[DroneId, str]) -> None:
    """Store the keys of new drones."""
    rows = [
        {"drone_id": drone_id, "is_required": True, "public_key": key, "next_public_key": None}
        for drone_id, key in public_keys.items()
    ]
    if rows:
        await tx.execute(drone_signing_keys.insert(), rows)
        await tx.execute(_NOTE_SIGNING, [{"of_drone": each} for each in public_keys])


async def put_key(tx: Tx, drone_id: DroneId, public_key: str | None) -> None:
    """Let a drone sign with this key from now on, or sign nothing as before; it has no next key.

    Raises
    ------
    InvalidInput
        The drone has signed before, and there is no key.
    """
    if public_key is None:
        await _sign_nothing(tx, drone_id)
        return
    row = {"is_required": True, "public_key": public_key, "next_public_key": None}
    statement = tx.insert(drone_signing_keys).values(drone_id=drone_id, **row)
    await tx.execute(statement.on_conflict_do_update(index_elements=["drone_id"], set_=row))
    await tx.execute(_NOTE_SIGNING, {"of_drone": drone_id})


async def put_next_key(tx: Tx, drone_id: DroneId, public_key: str | None) -> None:
    """Store the key that comes into force with the drone's next credentials, or that none does.

    Raises
    ------
    InvalidInput
        The drone has signed before, and there is no key.
    """
    if public_key is None:
        await _sign_nothing(tx, drone_id)
        return
    row = {"is_required": False, "public_key": None, "next_public_key": public_key}
    statement = tx.insert(drone_signing_keys).values(drone_id=drone_id, **row)
    changed = {"next_public_key": public_key}
    await tx.execute(statement.on_conflict_do_update(index_elements=["drone_id"], set_=changed))


async def bring_into_force(tx: Tx, drone_id: DroneId) -> None:
    """Let a drone sign with its next key from now on; nothing happens without one."""
    await tx.execute(_FOLLOW, {"of_drone": drone_id})
    await tx.execute(_NOTE_SIGNING, {"of_drone": drone_id})


async def revoke(tx: Tx, drone_id: DroneId) -> None:
    """Believe nothing of a drone that signs until it has another key, and forget its next key."""
    await tx.execute(_REVOKE, {"of_drone": drone_id})


async def _sign_nothing(tx: Tx, drone_id: DroneId) -> None:
    if (await tx.execute(_REQUIRED, {"of_drone": drone_id})).one_or_none() is not None:
        raise InvalidInput("public_key", "is missing, and this drone signs its messages")
    # A key that somebody else named before must not come into force with these credentials.
    await tx.execute(_REVOKE, {"of_drone": drone_id})


def _signature(row: AnyRow) -> DroneSignature:  # with the columns of `_SIGNATURES`
    return DroneSignature(
        drone_id=row.drone_id,
        is_signed=bool(row.is_required),
        public_key=row.public_key,
        network_id=row.network_id,
    )


def _on_curve(key: str | None) -> str | None:
    """The key, if it is one; a `ValueError` if it is none."""
    try:
        if key is not None:
            public_key_bytes(key)
    except InvalidInput as error:
        raise ValueError(error.detail) from error
    return key


#: The public key of a drone that signs, None of a drone that does not.
SigningKey = Annotated[
    PublicKey | None,
    AfterValidator(_on_curve),
    Field(
        description="the drone's Ed25519 public key: its messages are believed only with a valid "
        "signature from then on. A drone that has signed before cannot leave it out"
    ),
]


@dataclass(frozen=True, slots=True)
class StoredKeys:
    """`KeySource` of the database."""

    db: Database
    clock: FleetClock

    async def of(self, drone_ids: Collection[DroneId]) -> Sequence[DroneSignature]:
        """How each of these drones signs; one that is not registered is left out."""
        async with self.db.read() as connection:
            return await signatures_of(connection, drone_ids)

    async def changed(self) -> Sequence[DroneSignature]:
        """How the drones sign whose credentials have changed within a minute."""
        since_wall_at = self.clock.wall_now() - CHANGES_NAMED_FOR
        async with self.db.read() as connection:
            return await changed_since(connection, since_wall_at=since_wall_at)
