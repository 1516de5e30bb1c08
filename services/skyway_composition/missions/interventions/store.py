"""All SQL of interventions: cancellations, and the missions and packages they change."""

from sqlalchemy import insert, select, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.mission import Cancellation
from skyway.ids import DeliveryId, DroneId
from skyway.runtime.sql.database import Tx
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.tables import cancellations, is_live, missions


async def cancellation(
    tx: Tx, delivery_id: DeliveryId, cancellation_id: str
) -> Cancellation | None:
    """The earlier answer to a cancellation; None when it comes for the first time."""
    found = await tx.execute(
        select(cancellations.c.answer).where(
            cancellations.c.delivery_id == delivery_id,
            cancellations.c.cancellation_id == cancellation_id,
        )
    )
    answer = found.scalar_one_or_none()
    return None if answer is None else Cancellation.read(answer)


async def add_cancellation(
    tx: Tx, delivery_id: DeliveryId, cancellation_id: str, *, answer: Cancellation, at_ms: int
) -> None:
    """Save the answer to a cancellation, for repeated requests."""
    await tx.execute(
        insert(cancellations).values(
            delivery_id=delivery_id,
            cancellation_id=cancellation_id,
            answer=answer.model_dump_json(),
            at_ms=at_ms,
        )
    )


async def drones_serving(connection: AsyncConnection, delivery_id: DeliveryId) -> list[DroneId]:
    """The drones on live missions of a delivery, in the order of their trips."""
    found = await connection.execute(
        select(missions.c.drone_id)
        .where(missions.c.delivery_id == delivery_id, is_live)
        .order_by(missions.c.attempt, missions.c.trip)
    )
    return list(found.scalars())


async def save_request(tx: Tx, record: MissionRecord) -> None:
    """Save the changed packages of a mission: fewer packages, or other masses."""
    await tx.execute(
        update(missions)
        .where(missions.c.mission_id == record.mission_id)
        .values(request=record.request.model_dump_json())
    )
