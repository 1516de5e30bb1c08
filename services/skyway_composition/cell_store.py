"""All SQL of cells: the work that a move of this server has to wait for, and the rows to copy."""

from typing import Final

from sqlalchemy import func, select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import NetworkId
from skyway.runtime.sql.revisions import read_standing
from skyway_composition.tables import (
    alarms,
    closures,
    drone_links,
    is_open,
    metadata,
    missions,
    networks,
    offer_holds,
    outbox,
    replicas,
    seals,
)

#: The tables that are copied and compared. Live replicas and seals belong to the server itself.
HELD: Final = tuple(table for table in metadata.sorted_tables if table not in (replicas, seals))

#: Changes that add no row. They differ if a row changed after the database was copied.
_CHANGES: Final = {
    "versions of networks": select(func.sum(networks.c.version + networks.c.conditions)),
    "lifted closures": select(func.count(closures.c.lifted_ms)),
    "acknowledged alarms": select(func.count(alarms.c.acknowledged_ms)),
    "instructions of drones": select(func.sum(drone_links.c.stream + drone_links.c.last_seq)),
}


async def network_ids(connection: AsyncConnection) -> tuple[NetworkId, ...]:
    """All networks of this database."""
    found = await connection.execute(select(networks.c.network_id).order_by(networks.c.network_id))
    return tuple(found.scalars())


async def revision(connection: AsyncConnection) -> str | None:
    """The newest migration of this database; None if the database was never migrated."""
    standing = await connection.run_sync(read_standing)
    return None if standing is None else standing.revision


async def open_missions(connection: AsyncConnection) -> int:
    """The number of missions that are not over."""
    query = select(func.count()).select_from(missions).where(is_open)
    return int((await connection.execute(query)).scalar_one())


async def held_offers(connection: AsyncConnection, *, at_ms: int) -> int:
    """The number of holds in force at this moment of fleet time."""
    query = select(func.count()).select_from(offer_holds).where(offer_holds.c.until_ms > at_ms)
    return int((await connection.execute(query)).scalar_one())


async def unsent_messages(connection: AsyncConnection) -> int:
    """The number of messages that wait to be sent."""
    return int((await connection.execute(select(func.count()).select_from(outbox))).scalar_one())


async def rows(connection: AsyncConnection) -> dict[str, int]:
    """The number of rows of each table, and the numbers of changes that add no row."""
    counts = {table.name: select(func.count()).select_from(table) for table in HELD}
    return {
        name: int((await connection.execute(query)).scalar_one() or 0)
        for name, query in (counts | _CHANGES).items()
    }
