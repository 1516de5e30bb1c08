"""All SQL of custody: links are added to the chains of packages, never changed."""

from collections.abc import Iterable
from typing import Any, Final

from sqlalchemy import bindparam, insert, select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import DeliveryId, PackageId
from skyway.runtime.sql.database import Tx
from skyway_composition.missions.mission.custody import Custodian, Held
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.tables import custody

# Every booking and every message of a drone needs these statements. Building them takes longer
# than running them, so they are built once.
_CHAIN: Final = (
    select(custody).where(custody.c.delivery_id == bindparam("delivery_id")).order_by(custody.c.seq)
)
_ADD_CUSTODY: Final = insert(custody)


async def held_packages(
    connection: AsyncConnection, delivery_id: DeliveryId
) -> dict[PackageId, Held]:
    """Who holds each package of a delivery now."""
    found = await connection.execute(_CHAIN, {"delivery_id": delivery_id})
    return {
        row.package_id: Held(
            row.package_id, row.seq, Custodian(row.custodian_kind, row.custodian_id)
        )
        for row in found
    }


def begin_custody(tx: Tx, record: MissionRecord, rows: Iterable[Held], *, at_ms: int) -> None:
    """Add the first links of the packages' chains when the transaction ends."""
    tx.add(custody, _custody_rows(record, rows, at_ms=at_ms))


async def add_custody(tx: Tx, record: MissionRecord, rows: Iterable[Held], *, at_ms: int) -> None:
    """Add links to the packages' chains; each number occurs once in a chain."""
    added = _custody_rows(record, rows, at_ms=at_ms)
    if added:
        await tx.execute(_ADD_CUSTODY, added)


def _custody_rows(
    record: MissionRecord, rows: Iterable[Held], *, at_ms: int
) -> list[dict[str, Any]]:  # column values of any type
    return [
        {
            "delivery_id": record.mission.delivery_id,
            "package_id": held.package_id,
            "seq": held.seq,
            "custodian_kind": held.custodian.kind,
            "custodian_id": held.custodian.custodian_id,
            "mission_id": record.mission_id,
            "at_ms": at_ms,
        }
        for held in rows
    ]
