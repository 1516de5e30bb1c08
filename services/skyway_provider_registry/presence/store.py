"""All SQL of presence and of mission hints: composition's reports on the missions of drones.

The reported state of each mission is kept for a day after its end.
"""

from collections.abc import Iterable, Sequence
from datetime import datetime
from typing import Final

from sqlalchemy import (
    BigInteger,
    Insert,
    Text,
    bindparam,
    delete,
    func,
    literal_column,
    or_,
    select,
    update,
)
from sqlalchemy.dialects import postgresql
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.mission import LIVE_MISSION_STATES
from skyway.contracts.mission_reports import FreeFrom, MissionReport
from skyway.geo import Position
from skyway.ids import DroneId, MissionId, ProviderId
from skyway.runtime.sql.connection import AnyRow
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms, ms_to_moment
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
_TOUCH: Final = (
    presence.update()
    .where(presence.c.drone_id == bindparam("about", type_=Text))
    .values(changed=bindparam("change", type_=BigInteger))
)

_waiting = mission_hints.c.mission_state == literal_column("'QUEUED'")
_last_of_drone = (
    select(mission_hints.c.mission_id)
    .where(mission_hints.c.drone_id == drones.c.drone_id, or_(mission_hints.c.is_live, _waiting))
    .order_by(mission_hints.c.free_ms.desc().nulls_first(), mission_hints.c.mission_id.desc())
    .limit(literal_column("1"))
    .scalar_subquery()
)
#: The mission of a drone that ends last, of those that are not over. A query over drones joins it.
LAST_MISSION: Final = mission_hints.alias("last_mission")
IS_LAST_MISSION: Final = LAST_MISSION.c.mission_id == _last_of_drone

_FREE_COLUMNS: Final = ("free_ms", "free_station_id", "free_soc")

#: Wall ms for which an ended mission is kept, so that a late copy of a report does not revive it.
_REMEMBERED_MS: Final = 24 * 3600 * 1000

_DELETE_OLD: Final = delete(mission_hints).where(
    mission_hints.c.drone_id == bindparam("about", type_=Text),
    mission_hints.c.is_live.is_(False),
    mission_hints.c.reported_wall_ms < bindparam("before_ms", type_=BigInteger),
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
    await tx.execute(_TOUCH, {"about": drone_id, "change": change})


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


async def store_reports(tx: Tx, reports: Sequence[MissionReport], *, wall_at: datetime) -> None:
    """Store reports that are new, of drones of the named provider.

    Of each mission state only the first report is stored, and those that name another drone or say
    when the drone is free: others would change nothing. A QUEUED mission may come from another
    drone, whose presence changes too.
    """
    change, wall_ms = await next_change(tx), moment_to_ms(wall_at)
    rows = [
        {
            "mission_id": report.mission_id,
            "about": report.drone_id,
            "of_provider": report.provider_id,
            "seq": report.seq,
            "mission_state": report.mission_state,
            "is_live": report.mission_state in LIVE_MISSION_STATES,
            "reported_wall_ms": wall_ms,
            **_free(report.free_from),
        }
        for report in reports
    ]
    await tx.execute(_STORE_REPORT, rows)
    before = [each.drone_before for each in reports if each.drone_before is not None]
    touched = [
        {"about": each, "change": change} for each in (*(row["about"] for row in rows), *before)
    ]
    await tx.execute(_TOUCH, touched)
    before_ms = wall_ms - _REMEMBERED_MS
    ended = [{"about": row["about"], "before_ms": before_ms} for row in rows if not row["is_live"]]
    if ended:
        await tx.execute(_DELETE_OLD, ended)


def free_from_of(row: AnyRow) -> FreeFrom | None:
    """When and where the drone of a row of `LAST_MISSION` can begin another mission."""
    if row.free_ms is None:
        return None
    return FreeFrom(at=ms_to_moment(row.free_ms), station_id=row.free_station_id, soc=row.free_soc)


def _free(free_from: FreeFrom | None) -> dict[str, object]:
    """The columns that say when and where the drone can begin another mission."""
    if free_from is None:
        return dict.fromkeys(_FREE_COLUMNS)
    values = (moment_to_ms(free_from.at), free_from.station_id, free_from.soc)
    return dict(zip(_FREE_COLUMNS, values, strict=True))


def _store_report() -> Insert:
    """An insert of a report that is new and whose drone belongs to the named provider."""
    names = ("seq", "mission_state", "is_live", "reported_wall_ms", *_FREE_COLUMNS)
    values = [
        bindparam(name, type_=mission_hints.c[name].type).label(name)
        for name in ("mission_id", *names)
    ]
    own = select(drones.c.drone_id, *values).where(
        drones.c.drone_id == bindparam("about", type_=Text),
        drones.c.provider_id == bindparam("of_provider", type_=Text),
    )
    # This also works with SQLite: both dialects write ON CONFLICT in the same way.
    new = postgresql.insert(mission_hints).from_select(["drone_id", "mission_id", *names], own)
    is_new = (mission_hints.c.seq < new.excluded.seq) & or_(
        mission_hints.c.mission_state != new.excluded.mission_state,
        mission_hints.c.drone_id != new.excluded.drone_id,
        new.excluded.free_ms.is_not(None),
    )
    changed = {name: new.excluded[name] for name in ("drone_id", *names)}
    return new.on_conflict_do_update(index_elements=["mission_id"], set_=changed, where=is_new)


# Built once: building a statement takes as long as running it.
_STORE_REPORT: Final = _store_report()
