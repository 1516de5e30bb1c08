"""All SQL of the picture's deliveries: those that are not over, and what they are."""

from collections.abc import Collection, Sequence
from typing import Final

from sqlalchemy import select, text
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import DeliveryId, SubjectId
from skyway.runtime.sql.in_list import in_list
from skyway_gateway.deliveries.lifecycle.delivery import Delivery
from skyway_gateway.deliveries.records.delivery_store import with_parts
from skyway_gateway.delivery_tables import IS_LIVE, deliveries, is_live_row

_LIVE: Final = select(deliveries.c.delivery_id, deliveries.c.version).where(
    text(IS_LIVE), is_live_row(deliveries.c.customer_id)
)
_NAMED: Final = select(deliveries).where(in_list(deliveries.c.delivery_id, "delivery_ids"))
_CUSTOMERS: Final = select(deliveries.c.delivery_id, deliveries.c.customer_id).where(
    in_list(deliveries.c.delivery_id, "delivery_ids")
)


async def live_versions(connection: AsyncConnection) -> dict[DeliveryId, int]:
    """The deliveries that are not over, each with the number of its last change."""
    rows = await connection.execute(_LIVE)
    return {row.delivery_id: row.version for row in rows}


async def deliveries_named(
    connection: AsyncConnection, delivery_ids: Collection[DeliveryId]
) -> Sequence[Delivery]:
    """The deliveries with these ids."""
    rows = (await connection.execute(_NAMED, {"delivery_ids": [*delivery_ids]})).all()
    return await with_parts(connection, rows)


async def customers_of(
    connection: AsyncConnection, delivery_ids: Collection[DeliveryId]
) -> dict[DeliveryId, SubjectId]:
    """Who requested each of these deliveries."""
    rows = await connection.execute(_CUSTOMERS, {"delivery_ids": [*delivery_ids]})
    return {row.delivery_id: row.customer_id for row in rows}
