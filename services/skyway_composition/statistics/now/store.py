"""All SQL of what is under way: few rows, found by the indexes of what is not over."""

from collections.abc import Mapping

from sqlalchemy import func, select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import ProviderId
from skyway_composition.tables import is_live, missions, outbox


async def live_missions(
    connection: AsyncConnection, provider_id: ProviderId | None
) -> Mapping[str, int]:
    """How many missions that are not over are in which state."""
    query = select(missions.c.state, func.count()).where(is_live).group_by(missions.c.state)
    if provider_id is not None:
        query = query.where(missions.c.provider_id == provider_id)
    return dict((await connection.execute(query)).all())


async def unsent(connection: AsyncConnection) -> Mapping[str, int]:
    """How many messages wait in the outbox, by channel."""
    query = select(outbox.c.channel, func.count()).group_by(outbox.c.channel)
    return dict((await connection.execute(query)).all())
