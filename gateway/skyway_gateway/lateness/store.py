"""All SQL of the lateness of packages that were delivered."""

from collections.abc import Sequence
from typing import Final

from sqlalchemy import BigInteger, Integer, bindparam, select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.runtime.sql.connection import AnyRow
from skyway_gateway.delivery_tables import deliveries, missions, packages

_DELIVERED: Final = (
    select(
        packages.c.delivery_id,
        packages.c.package_id,
        packages.c.promised_ms,
        packages.c.promised_p90_ms,
        packages.c.delivered_ms,
        missions.c.start_ms,
        missions.c.provider_id,
        deliveries.c.network_id,
    )
    .join(missions, missions.c.mission_id == packages.c.mission_id)
    .join(deliveries, deliveries.c.delivery_id == packages.c.delivery_id)
    .where(
        packages.c.delivered_ms >= bindparam("since_ms", type_=BigInteger),
        packages.c.promised_ms.is_not(None),
        missions.c.start_ms.is_not(None),
    )
    .order_by(packages.c.delivered_ms.desc(), packages.c.delivery_id, packages.c.package_id)
    .limit(bindparam("most", type_=Integer))
)


async def delivered_since(
    connection: AsyncConnection, since_ms: int, *, most: int
) -> Sequence[AnyRow]:
    """The last packages that were delivered at `since_ms` of fleet time or later, oldest first."""
    found = await connection.execute(_DELIVERED, {"since_ms": since_ms, "most": most})
    return found.all()[::-1]
