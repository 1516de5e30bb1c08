"""All SQL of the closures."""

from typing import Any

from sqlalchemy import Row, or_, select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import NetworkId
from skyway_composition.closures.closure import Area, Closure
from skyway_composition.tables import closures, networks


async def in_force(
    connection: AsyncConnection, network_id: NetworkId, *, after_ms: int
) -> tuple[Closure, ...]:
    """What is closed in a network at some time after this moment, ground stops everywhere too."""
    found = await connection.execute(
        select(closures)
        .where(
            or_(closures.c.network_id == network_id, closures.c.network_id.is_(None)),
            closures.c.lifted_ms.is_(None),
            or_(closures.c.until_ms.is_(None), closures.c.until_ms > after_ms),
        )
        .order_by(closures.c.closure_id)
    )
    return tuple(_closure(row) for row in found)


async def conditions_number(connection: AsyncConnection, network_id: NetworkId) -> int:
    """How often the conditions of a network have changed."""
    found = await connection.execute(
        select(networks.c.conditions).where(networks.c.network_id == network_id)
    )
    number: int = found.scalar_one()
    return number


def _closure(row: Row[Any]) -> Closure:  # a row of closures
    return Closure(
        closure_id=row.closure_id,
        kind=row.kind,
        network_id=row.network_id,
        from_ms=row.from_ms,
        made_ms=row.made_ms,
        until_ms=row.until_ms,
        lifted_ms=row.lifted_ms,
        station_id=row.station_id,
        pad=row.pad,
        to_station_id=row.to_station_id,
        area=None if row.area is None else Area.read(row.area),
        provider_id=row.provider_id,
        drone_model_id=row.drone_model_id,
        reason=row.reason,
    )
