"""All SQL of the numbers of calendars."""

from collections.abc import Collection
from typing import Final

from sqlalchemy import select, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import DroneId
from skyway.runtime.sql.database import Tx
from skyway.runtime.sql.in_list import in_list
from skyway_composition.tables import drone_links

_IS_ASKED: Final = in_list(drone_links.c.drone_id, "drone_ids")
_VERSIONS: Final = select(drone_links.c.drone_id, drone_links.c.calendar_version).where(_IS_ASKED)
_RAISE: Final = (
    update(drone_links).where(_IS_ASKED).values(calendar_version=drone_links.c.calendar_version + 1)
)


async def calendar_versions(
    connection: AsyncConnection, drone_ids: Collection[DroneId]
) -> dict[DroneId, int]:
    """The present numbers of these drones' calendars, 0 for a drone without a link."""
    found = await connection.execute(_VERSIONS, {"drone_ids": [*drone_ids]})
    return dict.fromkeys(drone_ids, 0) | {row.drone_id: row.calendar_version for row in found}


async def raise_versions(tx: Tx, drone_ids: Collection[DroneId]) -> None:
    """Raise the calendar versions of locked drones in this transaction."""
    if drone_ids:
        await tx.execute(_RAISE, {"drone_ids": [*drone_ids]})
