"""Reads the drones of all providers, for operators."""

from collections.abc import Sequence
from datetime import datetime
from typing import Final

from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import ProviderId
from skyway.runtime.http.paging import PageQuery
from skyway_provider_registry.fleets.drone import Drone, DroneStateName
from skyway_provider_registry.fleets.store import page_of_all

#: Drones that are read together while those of one state are searched.
_READ_TOGETHER: Final = 500


async def page(
    connection: AsyncConnection,
    query: PageQuery,
    *,
    provider_id: ProviderId | None,
    state: DroneStateName | None,
    wall_now: datetime,
) -> Sequence[Drone]:
    """Up to limit + 1 drones, sorted by id.

    The state of a drone is not stored but decided here, so drones in other states are read, too.
    """
    after = query.after_id()
    together = query.limit + 1 if state is None else _READ_TOGETHER
    found: list[Drone] = []
    while len(found) <= query.limit:
        read = await page_of_all(connection, provider_id=provider_id, after=after, limit=together)
        shown = [drone.shown(wall_now) for drone in read]
        found += [drone for drone in shown if state in (None, drone.state)]
        if len(read) < together:
            break
        after = read[-1].drone_id
    return found[: query.limit + 1]
