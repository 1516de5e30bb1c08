"""All SQL of mission hints: the reported state of each mission, kept for a day after its end."""

from collections.abc import Sequence
from datetime import datetime
from typing import Final

from sqlalchemy import BigInteger, Insert, Text, bindparam, delete, literal_column, or_, select
from sqlalchemy.dialects import postgresql

from skyway.contracts.mission import LIVE_MISSION_STATES
from skyway.contracts.mission_reports import FreeFrom, MissionReport
from skyway.runtime.sql.connection import AnyRow
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms, ms_to_moment
from skyway_provider_registry.change_store import next_change
from skyway_provider_registry.presence.store import TOUCH
from skyway_provider_registry.tables import drones, mission_hints

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


async def store_reports(tx: Tx, reports: Sequence[MissionReport], *, wall_at: datetime) -> None:
    """Store reports that are new, of drones of the named provider.

    Of each mission state only the first report is stored, and those that say when the drone is
    free: others would change nothing.
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
    await tx.execute(TOUCH, [{"about": row["about"], "change": change} for row in rows])
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
        new.excluded.free_ms.is_not(None),
    )
    changed = {name: new.excluded[name] for name in names}
    return new.on_conflict_do_update(index_elements=["mission_id"], set_=changed, where=is_new)


# Built once: building a statement takes as long as running it.
_STORE_REPORT: Final = _store_report()
_DELETE_OLD: Final = delete(mission_hints).where(
    mission_hints.c.drone_id == bindparam("about", type_=Text),
    mission_hints.c.is_live.is_(False),
    mission_hints.c.reported_wall_ms < bindparam("before_ms", type_=BigInteger),
)
