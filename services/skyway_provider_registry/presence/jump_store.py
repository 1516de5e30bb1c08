"""All SQL of jumps and of waiting alarms: last states, and drones that are taken out of service."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any, Final

from sqlalchemy import Row, select, true, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.drones import DroneAlarm
from skyway.drone.model import DroneModel
from skyway.drone.models import DRONE_MODELS
from skyway.geo import Position
from skyway.ids import DroneId, DroneModelId, NetworkId
from skyway.runtime.sql.database import Tx
from skyway.runtime.sql.in_list import in_list
from skyway.units import ms_to_moment
from skyway_provider_registry.presence.jump import Ahead, LastSeen
from skyway_provider_registry.presence.store import touch
from skyway_provider_registry.tables import drone_models, drones, presence, waiting_alarms

#: How long a state is on its way at most, fleet milliseconds. Our own choice.
_ON_ITS_WAY_MS: Final = 60_000

#: Each batch of states runs this statement, so it is built once. A drone in maintenance may be
#: carried, and after a renewal of credentials its earlier states may be anybody's.
_LAST_SEEN: Final = (
    select(
        presence.c.drone_id,
        presence.c.state_session,
        presence.c.state_seq,
        presence.c.sample_session,
        presence.c.sample_seq,
        presence.c.state_at_ms,
        presence.c.state_seen_ms,
        presence.c.last_seen_ms,
        presence.c.longitude_deg,
        presence.c.latitude_deg,
        presence.c.soc,
        presence.c.activity,
        presence.c.mission_id,
        presence.c.ahead_m,
        presence.c.ahead_soc,
        drones.c.model_id,
        drones.c.battery_changed_ms,
    )
    .join(drones, drones.c.drone_id == presence.c.drone_id)
    .where(
        in_list(presence.c.drone_id, "drone_ids"),
        presence.c.activity.is_not(None),
        presence.c.state_session >= 0,
        drones.c.is_in_maintenance.is_(False),
    )
)


async def last_seen(
    connection: AsyncConnection,
    drone_ids: Collection[DroneId],
    models: dict[DroneModelId, DroneModel],
) -> dict[DroneId, LastSeen]:
    """The last states of these drones, of those that are in service; fills in missing `models`."""
    found = await connection.execute(_LAST_SEEN, {"drone_ids": sorted(drone_ids)})
    rows = found.all()
    missing = {row.model_id for row in rows} - models.keys()
    if missing:
        models.update(await _models_of(connection, missing))
    return {
        DroneId(row.drone_id): _last_seen(row, models) for row in rows if row.model_id in models
    }


async def _models_of(
    connection: AsyncConnection, model_ids: Collection[DroneModelId]
) -> Mapping[DroneModelId, DroneModel]:
    query = select(drone_models.c.model).where(drone_models.c.model_id.in_(sorted(model_ids)))
    added = [DroneModel.read(text) for text in (await connection.execute(query)).scalars()]
    known = {model_id: DRONE_MODELS[model_id] for model_id in model_ids if model_id in DRONE_MODELS}
    return known | {model.model_id: model for model in added}


def _last_seen(row: Row[*tuple[Any, ...]], models: Mapping[DroneModelId, DroneModel]) -> LastSeen:
    received_ms = row.last_seen_ms if row.state_seen_ms is None else row.state_seen_ms
    return LastSeen(
        session=row.state_session,
        seq=row.state_seq,
        sample_order=(row.sample_session, row.sample_seq),
        received_at=ms_to_moment(received_ms),
        position=Position(row.longitude_deg, row.latitude_deg),
        soc=row.soc,
        ahead=Ahead(row.ahead_m, row.ahead_soc),
        model=models[row.model_id],
        activity=row.activity,
        mission_id=row.mission_id,
        has_other_battery=row.battery_changed_ms is not None
        and _is_before(row, row.battery_changed_ms, received_ms=received_ms),
    )


def _is_before(row: Row[*tuple[Any, ...]], changed_ms: int, *, received_ms: int) -> bool:
    """Whether the last state is about the battery before the change.

    It may have been on its way then. The drone's own moment counts only so far: with a clock that
    is an hour late each charge would be that of another battery.
    """
    was_on_its_way = row.state_at_ms <= changed_ms and received_ms <= changed_ms + _ON_ITS_WAY_MS
    return received_ms <= changed_ms or was_on_its_way


async def put_in_maintenance(tx: Tx, alarms: Sequence[DroneAlarm]) -> None:
    """Put drones in maintenance, and keep the alarm about each until composition has it."""
    for alarm in alarms:
        await touch(tx, alarm.drone_id)
        this = drones.c.drone_id == alarm.drone_id
        await tx.execute(update(drones).where(this).values(is_in_maintenance=True))
        await keep_waiting(tx, alarm)


async def keep_waiting(tx: Tx, alarm: DroneAlarm) -> None:
    """Keep an alarm about a drone until composition has it.

    A WARNING replaces only one with its own code, such as the one that it ends.
    """
    statement = tx.insert(waiting_alarms).values(
        drone_id=alarm.drone_id, alarm=alarm.model_dump_json()
    )
    same_code = waiting_alarms.c.alarm.contains(f'"{alarm.code}"')
    await tx.execute(
        statement.on_conflict_do_update(
            index_elements=["drone_id"],
            set_={"alarm": statement.excluded.alarm},
            where=same_code if alarm.level == "WARNING" else true(),
        )
    )


async def waiting(
    connection: AsyncConnection, *, limit: int, without: Collection[NetworkId] = ()
) -> list[tuple[DroneAlarm, NetworkId]]:
    """The alarms that composition does not have yet, each with the network of its drone.

    Those of drones at home in the networks `without` are left out.
    """
    query = (
        select(waiting_alarms.c.alarm, drones.c.network_id)
        .join(drones, drones.c.drone_id == waiting_alarms.c.drone_id)
        .where(drones.c.network_id.not_in(without))
        .order_by(waiting_alarms.c.drone_id)
        .limit(limit)
    )
    found = await connection.execute(query)
    return [(DroneAlarm.read(row.alarm), row.network_id) for row in found]


async def remove_waiting(tx: Tx, alarm: DroneAlarm) -> None:
    """Forget an alarm that composition has."""
    await tx.execute(
        waiting_alarms.delete().where(
            waiting_alarms.c.drone_id == alarm.drone_id,
            waiting_alarms.c.alarm == alarm.model_dump_json(),
        )
    )
