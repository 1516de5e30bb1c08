"""All SQL of the networks of deliveries."""

from collections.abc import Collection

from sqlalchemy import select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.delivery.request import DeliveryRequest
from skyway.ids import DeliveryId, NetworkId, StationId
from skyway_gateway.delivery_tables import deliveries


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
