"""All SQL of cells."""

from collections.abc import Mapping
from typing import Final

from sqlalchemy import and_, func, select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import NetworkId
from skyway_composition.tables import is_open, missions, networks

_OPEN: Final = (
    select(networks.c.network_id, func.count(missions.c.mission_id))
    .select_from(networks)
    .outerjoin(missions, and_(missions.c.network_id == networks.c.network_id, is_open))
    .group_by(networks.c.network_id)
)


async def open_missions(connection: AsyncConnection) -> Mapping[NetworkId, int]:
    """The number of missions that are not over, of each network of this database."""
    return {row[0]: row[1] for row in await connection.execute(_OPEN)}
