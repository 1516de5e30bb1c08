"""All SQL of the networks of deliveries and of the stored table of cells."""

from collections.abc import Collection
from typing import Final

from sqlalchemy import select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.cells import CellTable
from skyway.delivery.request import DeliveryRequest
from skyway.ids import DeliveryId, NetworkId, StationId
from skyway.runtime.sql.database import Database
from skyway_gateway.delivery_tables import deliveries
from skyway_gateway.tables import known_cells

#: The key of the only row.
_ONLY: Final = 1


async def networks_of(
    connection: AsyncConnection, delivery_ids: Collection[DeliveryId]
) -> dict[DeliveryId, tuple[NetworkId | None, StationId]]:
    """The network of each of these deliveries, if it was known, and its pickup."""
    columns = (deliveries.c.delivery_id, deliveries.c.network_id, deliveries.c.request)
    query = select(*columns).where(deliveries.c.delivery_id.in_(sorted(delivery_ids)))
    return {
        row.delivery_id: (row.network_id, DeliveryRequest.read(row.request).pickup.station_id)
        for row in await connection.execute(query)
    }


async def keep_cells(db: Database, table: CellTable) -> None:
    """Store this table of cells in place of an older one."""
    async with db.write() as tx:
        new = tx.insert(known_cells).values(only=_ONLY, cells=table.model_dump_json())
        await tx.execute(
            new.on_conflict_do_update(index_elements=["only"], set_={"cells": new.excluded.cells})
        )


async def read_cells(db: Database) -> CellTable:
    """The stored table of cells; an empty table if none is stored."""
    async with db.read() as connection:
        found = (await connection.execute(select(known_cells.c.cells))).scalar_one_or_none()
    return CellTable(cells=()) if found is None else CellTable.read(found)
