"""All SQL of QUEUED missions, which wait for the missions before them."""

from typing import Final

from sqlalchemy import bindparam, select, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import DeliveryId, DroneId
from skyway.runtime.sql.database import Tx
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.row import read_record
from skyway_composition.tables import is_queued, missions

#: No network has these conditions: composition plans the mission again.
NO_CONDITIONS: Final = -1

_QUEUED: Final = (
    select(missions)
    .where(missions.c.drone_id == bindparam("drone_id"), is_queued)
    .order_by(missions.c.start_ms)
)


async def queued_of_drone(connection: AsyncConnection, drone_id: DroneId) -> list[MissionRecord]:
    """The QUEUED missions of a drone, in the order of their starts."""
    found = await connection.execute(_QUEUED, {"drone_id": drone_id})
    return [read_record(row) for row in found]


async def queued_of_delivery(
    connection: AsyncConnection, delivery_id: DeliveryId
) -> list[MissionRecord]:
    """The QUEUED missions of a delivery, in the order of their trips."""
    found = await connection.execute(
        select(missions)
        .where(missions.c.delivery_id == delivery_id, is_queued)
        .order_by(missions.c.attempt, missions.c.trip)
    )
    return [read_record(row) for row in found]


async def plan_queue_again(tx: Tx, drone_id: DroneId) -> None:
    """Have the QUEUED missions of a drone planned again, because one has left its calendar."""
    await tx.execute(
        update(missions)
        .where(missions.c.drone_id == drone_id, is_queued)
        .values(planned_conditions=NO_CONDITIONS)
    )
