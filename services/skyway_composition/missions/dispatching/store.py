"""All SQL that reads what waits in the calendars of a fleet."""

from collections.abc import Collection
from typing import Final

from sqlalchemy import and_, or_, select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import DeliveryId, DroneId, NetworkId, ProviderId
from skyway.runtime.sql.in_list import in_list
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.row import read_record
from skyway_composition.tables import is_live, is_queued, missions

_WAITING_FLEETS: Final = (
    select(missions.c.network_id, missions.c.provider_id)
    .distinct()
    .where(is_queued)
    .order_by(missions.c.network_id, missions.c.provider_id)
)
_REFUSALS: Final = select(missions.c.delivery_id, missions.c.drone_id).where(
    in_list(missions.c.delivery_id, "delivery_ids"), missions.c.state == "REFUSED"
)


async def waiting_fleets(connection: AsyncConnection) -> list[tuple[NetworkId, ProviderId]]:
    """The networks and providers with QUEUED missions."""
    return [(row.network_id, row.provider_id) for row in await connection.execute(_WAITING_FLEETS)]


async def open_missions_of(
    connection: AsyncConnection, network_id: NetworkId, provider_id: ProviderId
) -> list[MissionRecord]:
    """The missions of a provider in a network that are not over, by drone and start.

    A mission that was sent comes before the QUEUED missions of its drone.
    """
    is_of_fleet = and_(missions.c.network_id == network_id, missions.c.provider_id == provider_id)
    found = await connection.execute(
        select(missions)
        .where(or_(and_(is_queued, is_of_fleet), and_(is_live, is_of_fleet)))
        .order_by(missions.c.drone_id, is_queued, missions.c.start_ms)
    )
    return [read_record(row) for row in found]


async def refusals_of(
    connection: AsyncConnection, delivery_ids: Collection[DeliveryId]
) -> frozenset[tuple[DeliveryId, DroneId]]:
    """The drones that have refused missions of these deliveries, with the delivery."""
    found = await connection.execute(_REFUSALS, {"delivery_ids": [*delivery_ids]})
    return frozenset((row.delivery_id, row.drone_id) for row in found)
