"""All SQL that reads presence, and that marks presence as changed for its readers."""

from collections.abc import Iterable
from datetime import datetime
from typing import Final

from sqlalchemy import BigInteger, Text, bindparam, func, select, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.geo import Position
from skyway.ids import DroneId, MissionId, ProviderId
from skyway.runtime.sql.connection import AnyRow
from skyway.runtime.sql.database import Tx
from skyway.units import ms_to_moment
from skyway_provider_registry.change_store import next_change
from skyway_provider_registry.presence.drone_presence import LastSample, LastState, Presence
from skyway_provider_registry.tables import drones, mission_hints, presence

#: Drone ids in one IN list: SQLite allows 32,766 parameters, and short lists are planned faster.
_CHUNK: Final = 500

_live: Final = (
    select(mission_hints.c.drone_id, func.max(mission_hints.c.mission_id).label("mission_id"))
    .where(mission_hints.c.is_live)
    .group_by(mission_hints.c.drone_id)
    .subquery("live")
)
_live_hint: Final = mission_hints.alias("live_hint")
_own_hint: Final = mission_hints.alias("own_hint")

#: The presence of each drone: its own messages, and composition's reports on its missions.
PRESENCE: Final = (
    select(
        presence,
        _live_hint.c.mission_id.label("live_mission_id"),
        _live_hint.c.mission_state.label("live_mission_state"),
        _own_hint.c.is_live.label("own_mission_is_live"),
    )
    .select_from(presence)
    .outerjoin(_live, _live.c.drone_id == presence.c.drone_id)
    .outerjoin(_live_hint, _live_hint.c.mission_id == _live.c.mission_id)
    .outerjoin(_own_hint, _own_hint.c.mission_id == presence.c.mission_id)
)
#: Makes every reader read a drone again; built once, since every mission report runs it.
TOUCH: Final = (
    presence.update()
    .where(presence.c.drone_id == bindparam("about", type_=Text))
    .values(changed=bindparam("change", type_=BigInteger))
)


async def owners(
    connection: AsyncConnection, drone_ids: Iterable[DroneId]
) -> dict[DroneId, ProviderId]:
    """The provider of each registered drone among these."""
    ids = sorted(set(drone_ids))
    found: dict[DroneId, ProviderId] = {}
    for start in range(0, len(ids), _CHUNK):
        some = drones.c.drone_id.in_(ids[start : start + _CHUNK])
        columns = select(drones.c.drone_id, drones.c.provider_id).where(some)
        rows = await connection.execute(columns)
        found.update((row.drone_id, row.provider_id) for row in rows)
    return found


async def cut_off(tx: Tx, drone_id: DroneId) -> None:
    """Count a drone as lost: Mosquitto sends no last will for a client that it disconnects."""
    change = await next_change(tx)
    was_connected = (presence.c.drone_id == drone_id) & presence.c.connection_status.is_not(None)
    await tx.execute(
        update(presence).where(was_connected).values(connection_status="LOST", changed=change)
    )


async def touch(tx: Tx, drone_id: DroneId) -> None:
    """Make every reader read this drone again."""
    change = await next_change(tx)
    await tx.execute(TOUCH, {"about": drone_id, "change": change})


def presence_of(row: AnyRow) -> Presence:
    """The presence in a row with the columns of `PRESENCE`."""
    state = sample = None
    if row.activity is not None:
        state = LastState(
            session=row.state_session,
            at=ms_to_moment(row.state_at_ms),
            activity=row.activity,
            station_id=row.station_id,
            position=Position(row.longitude_deg, row.latitude_deg),
            soc=row.soc,
            condition=row.condition,
        )
    if row.sample_at_ms is not None:
        sample = LastSample(
            session=row.sample_session,
            at=ms_to_moment(row.sample_at_ms),
            position=Position(row.sample_longitude_deg, row.sample_latitude_deg),
            soc=row.sample_soc,
        )
    return Presence(
        connection=row.connection_status,
        state=state,
        sample=sample,
        mission_id=_mission_of(row),
        mission_state=row.live_mission_state,
        names_mission=row.mission_id is not None and row.mission_id == row.live_mission_id,
        last_seen_at=_moment(row.last_seen_ms),
        last_seen_wall_at=_moment(row.last_seen_wall_ms),
    )


def _mission_of(row: AnyRow) -> MissionId | None:
    """The drone's mission; a mission that the drone names is ignored once composition ended it."""
    if row.live_mission_id is not None:
        return MissionId(row.live_mission_id)
    is_over = row.own_mission_is_live is not None and not row.own_mission_is_live
    return None if is_over else row.mission_id


def _moment(moment_ms: int | None) -> datetime | None:
    return None if moment_ms is None else ms_to_moment(moment_ms)
