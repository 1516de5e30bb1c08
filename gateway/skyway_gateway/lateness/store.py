"""All SQL of the lateness of packages that were delivered."""

from collections.abc import Sequence
from typing import Final

from sqlalchemy import BigInteger, Integer, bindparam, func, select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.runtime.sql.connection import AnyRow
from skyway_gateway.delivery_tables import deliveries, missions, packages

#: The last packages of a provider in a network that count. Our own choice.
MOST_OF_PROVIDER: Final = 300

_LAST: Final = (
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
    .subquery("last")
)
_place: Final = func.row_number().over(
    partition_by=(_LAST.c.network_id, _LAST.c.provider_id),
    order_by=(_LAST.c.delivered_ms.desc(), _LAST.c.delivery_id, _LAST.c.package_id),
)
_RANKED: Final = select(_LAST, _place.label("place")).subquery("ranked")
_DELIVERED: Final = (
    select(_RANKED)
    .where(_RANKED.c.place <= MOST_OF_PROVIDER)
    .order_by(_RANKED.c.delivered_ms, _RANKED.c.delivery_id, _RANKED.c.package_id)
)


async def delivered_since(
    connection: AsyncConnection, since_ms: int, *, most: int
) -> Sequence[AnyRow]:
    """The last packages that were delivered at `since_ms` of fleet time or later, oldest first.

    Of the `most` last packages, those that are among the last of their provider in their network.
    """
    found = await connection.execute(_DELIVERED, {"since_ms": since_ms, "most": most})
    return found.all()
