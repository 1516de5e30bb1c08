"""All SQL of missions, live and QUEUED, of the deliveries they serve, and of cancellations.

The steps and the custody of packages have their own stores.
"""

import json
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final

from sqlalchemy import ColumnElement, bindparam, insert, select, union_all, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.mission import Cancellation, Mission
from skyway.drone.model import DroneModel
from skyway.ids import DeliveryId, DroneId, MissionId, NetworkId, ProviderId
from skyway.runtime.sql.database import Tx
from skyway.runtime.sql.in_list import in_list
from skyway_composition.missions.mission.record import (
    MissionRecord,
    changing_columns,
    new_row,
    read_record,
)
from skyway_composition.missions.mission.share import shares_json
from skyway_composition.missions.mission.share_views import mission_for
from skyway_composition.tables import (
    cancellations,
    deliveries,
    first_planned_end_ms,
    guests,
    is_live,
    is_queued,
    missions,
)

#: No network has these conditions: composition plans the mission again.
NO_CONDITIONS: Final = -1

# Every booking and every message of a drone needs these statements. Building them takes longer
# than running them, so they are built once.
_LIVE: Final = (
    select(missions)
    .where(in_list(missions.c.drone_id, "drone_ids"), is_live)
    .order_by(missions.c.drone_id)
    .with_for_update()
)

_LIVE_AMONG: Final = select(missions.c.drone_id).where(
    in_list(missions.c.drone_id, "drone_ids"), is_live
)

_LIVE_DRONES: Final = select(missions.c.drone_id).where(is_live).order_by(missions.c.drone_id)

_QUEUED: Final = (
    select(missions)
    .where(missions.c.drone_id == bindparam("drone_id"), is_queued)
    .order_by(missions.c.start_ms)
)

# The steps of a mission are saved before the mission, so this reads the end of its next step.
_SAVE: Final = (
    update(missions)
    .where(missions.c.mission_id == bindparam("of_mission"))
    .values(next_end_ms=first_planned_end_ms)
)

# A weaker lock than that of a deletion: a transaction that has locked a drone may still save its
# missions, which name their delivery. With the stronger lock the two would wait for each other.
_LOCK: Final = (
    select(deliveries.c.closed_ms, deliveries.c.withdrawn_attempt)
    .where(deliveries.c.delivery_id == bindparam("of_delivery"))
    .with_for_update(key_share=True)
)


def is_of_delivery(delivery_id: str) -> ColumnElement[bool]:
    """Whether a mission flies for this delivery, alone or among others.

    One list of ids: with two conditions PostgreSQL reads all missions that ever were.
    """
    own = missions.alias("own")
    return missions.c.mission_id.in_(
        union_all(
            select(own.c.mission_id).where(own.c.delivery_id == delivery_id),
            select(guests.c.host_id).where(guests.c.delivery_id == delivery_id),
        )
    )


@dataclass(frozen=True, slots=True)
class LockedDelivery:
    """Whether nothing is booked for a delivery any more, and up to which attempt."""

    is_closed: bool
    withdrawn_attempt: int


@dataclass(frozen=True, slots=True)
class MissionFilter:
    """Which missions a list shows; `provider_id` is the calling provider, None for operators."""

    provider_id: ProviderId | None = None
    state: str | None = None
    delivery_id: str | None = None
    drone_id: str | None = None
    loading: str | None = None


async def missions_not_refused(
    connection: AsyncConnection, delivery_id: DeliveryId
) -> tuple[Mission, ...]:
    """The missions of a delivery that were not refused: queued, flying or ended."""
    found = await connection.execute(
        select(missions)
        .where(is_of_delivery(delivery_id), missions.c.state != "REFUSED")
        .order_by(missions.c.attempt, missions.c.trip)
    )
    return tuple(mission_for(read_record(row), delivery_id) for row in found)


def add(tx: Tx, record: MissionRecord, *, next_end_ms: int) -> None:
    """Add a mission, whose first step ends at `next_end_ms`, when the transaction ends.

    The transaction then fails with `RowRefused`: `mission_drone` if the drone has another mission,
    `mission_attempt` if this attempt was booked before.
    """
    tx.add(missions, [{**new_row(record), "next_end_ms": next_end_ms}])


async def save_all(tx: Tx, records: Iterable[MissionRecord]) -> None:
    """Save the changed columns of locked missions; their steps must be saved before."""
    rows = [{"of_mission": record.mission_id, **changing_columns(record)} for record in records]
    if rows:
        await tx.execute(_SAVE, rows)


def save_last(
    tx: Tx, records: Iterable[MissionRecord], *, next_ends_ms: Mapping[MissionId, int | None]
) -> None:
    """Save locked missions at the end of a transaction; some of them have another next step."""
    going_on, advanced = list[dict[str, Any]](), list[dict[str, Any]]()
    for record in records:
        row = {"mission_id": record.mission_id, **changing_columns(record)}
        if record.mission_id in next_ends_ms:
            advanced.append({**row, "next_end_ms": next_ends_ms[record.mission_id]})
        else:
            going_on.append(row)
    for rows in (going_on, advanced):
        tx.update_rows(missions, {}, rows, key="mission_id")


async def lock_live(tx: Tx, drone_ids: Collection[DroneId]) -> dict[DroneId, MissionRecord]:
    """The live missions of these drones, locked until the transaction ends."""
    found = await tx.execute(_LIVE, {"drone_ids": [*drone_ids]})
    return {row.drone_id: read_record(row) for row in found}


async def get(
    connection: AsyncConnection, mission_id: MissionId, *, provider_id: ProviderId | None
) -> MissionRecord | None:
    """A mission of this provider; with None, of any provider."""
    query = select(missions).where(missions.c.mission_id == mission_id)
    if provider_id is not None:
        query = query.where(missions.c.provider_id == provider_id)
    row = (await connection.execute(query)).one_or_none()
    return None if row is None else read_record(row)


async def host_of(connection: AsyncConnection, mission_id: MissionId) -> MissionId | None:
    """The host's mission that carries this guest's packages; None if the id is no guest's."""
    found = await connection.execute(
        select(guests.c.host_id).where(guests.c.mission_id == mission_id)
    )
    return found.scalar_one_or_none()


async def page(
    connection: AsyncConnection, shown: MissionFilter, *, before: str | None, limit: int
) -> list[MissionRecord]:
    """Missions with an id before the given one, the newest first."""
    query = select(missions).order_by(missions.c.mission_id.desc()).limit(limit)
    for column, value in (
        (missions.c.provider_id, shown.provider_id),
        (missions.c.state, shown.state),
        (missions.c.drone_id, shown.drone_id),
        (missions.c.loading, shown.loading),
    ):
        if value is not None:
            query = query.where(column == value)
    if shown.delivery_id is not None:
        query = query.where(is_of_delivery(shown.delivery_id))
    if before is not None:
        query = query.where(missions.c.mission_id < before)
    return [read_record(row) for row in await connection.execute(query)]


async def live_among(
    connection: AsyncConnection, drone_ids: Collection[DroneId]
) -> frozenset[DroneId]:
    """Which of these drones have a live mission."""
    found = await connection.execute(_LIVE_AMONG, {"drone_ids": [*drone_ids]})
    return frozenset(found.scalars())


async def live_drones(connection: AsyncConnection) -> list[DroneId]:
    """The drones that have a live mission."""
    found = await connection.execute(_LIVE_DRONES)
    return list(found.scalars())


async def lock_delivery(tx: Tx, delivery_id: DeliveryId) -> LockedDelivery:
    """The delivery, locked; its row is added if missing.

    Other transactions that lock the same delivery wait for this one.
    """
    values = {"of_delivery": delivery_id}
    found = (await tx.execute(_LOCK, values)).one_or_none()
    if found is None:
        added = tx.insert(deliveries).on_conflict_do_nothing()
        await tx.execute(added, {"delivery_id": delivery_id})
        found = (await tx.execute(_LOCK, values)).one()
    return LockedDelivery(found.closed_ms is not None, found.withdrawn_attempt)


def add_delivery(tx: Tx, delivery_id: DeliveryId) -> None:
    """Add a delivery when the transaction ends.

    The transaction then fails with `RowRefused` (`deliveries_pkey`) if another one has added it.
    """
    tx.add(deliveries, [{"delivery_id": delivery_id}])


async def close_delivery(tx: Tx, delivery_id: DeliveryId, now_ms: int) -> None:
    """Mark a delivery as closed: nothing is booked for it from now on."""
    await tx.execute(
        update(deliveries).where(deliveries.c.delivery_id == delivery_id).values(closed_ms=now_ms)
    )


async def withdraw_attempts(tx: Tx, delivery_id: DeliveryId, *, until: int) -> None:
    """Book no attempt up to this one any more."""
    this = deliveries.c.delivery_id == delivery_id
    await tx.execute(update(deliveries).where(this).values(withdrawn_attempt=until))


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
        .where(is_of_delivery(delivery_id), is_queued)
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
        .where(is_of_delivery(delivery_id), is_live)
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


async def models_of_missions(
    connection: AsyncConnection, network_id: NetworkId
) -> dict[MissionId, DroneModel]:
    """The drone model of each live mission in a network."""
    found = await connection.execute(
        select(missions.c.mission_id, missions.c.candidate).where(
            missions.c.network_id == network_id, is_live
        )
    )
    # Many missions share a model, and reading the whole candidate takes much longer.
    texts = {row.mission_id: json.dumps(json.loads(row.candidate)["model"]) for row in found}
    models = {each: DroneModel.read(each) for each in {*texts.values()}}
    return {mission_id: models[each] for mission_id, each in texts.items()}


async def save_troubles(tx: Tx, records: Iterable[MissionRecord]) -> None:
    """Save the troubles and report numbers of locked missions; plan for them now."""
    rows = [
        {
            "of_mission": record.mission_id,
            "trouble": None if record.trouble is None else record.trouble.model_dump_json(),
            "report_seq": record.report_seq,
            "shares": shares_json(record.shares),
        }
        for record in records
    ]
    if rows:
        of_mission = missions.c.mission_id == bindparam("of_mission")
        await tx.execute(update(missions).where(of_mission).values(retry_wall_ms=0), rows)
