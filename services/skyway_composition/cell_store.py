"""All SQL of cells."""

from collections.abc import Mapping

from sqlalchemy import and_, func, select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import NetworkId
from skyway_composition.tables import is_open, missions, networks


async def open_missions(connection: AsyncConnection) -> Mapping[NetworkId, int]:
    """The number of missions that are not over, of each network of this database."""
    its_missions = and_(missions.c.network_id == networks.c.network_id, is_open)
    counted = select(networks.c.network_id, func.count(missions.c.mission_id))
    joined = counted.select_from(networks).outerjoin(missions, its_missions)
    found = await connection.execute(joined.group_by(networks.c.network_id))
    return {row[0]: row[1] for row in found}
