"""All SQL of the fleets' statistics: drones that are alike are counted by the database."""

from collections.abc import Sequence

from sqlalchemy import and_, case, func, literal, or_, select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import ProviderId
from skyway.runtime.sql.connection import AnyRow
from skyway_provider_registry.presence.store import KNOWN
from skyway_provider_registry.tables import drones

_known = KNOWN.subquery("known")

#: On a mission: composition says so, or the drone does and composition does not know better.
_has_mission = or_(
    _known.c.live_mission_id.is_not(None),
    and_(
        _known.c.mission_id.is_not(None),
        or_(_known.c.own_mission_is_live.is_(None), _known.c.own_mission_is_live),
    ),
)
_newest_ms = case(
    (_known.c.sample_at_ms > _known.c.state_at_ms, _known.c.sample_at_ms),
    else_=_known.c.state_at_ms,
)
_late_ms = _known.c.last_seen_ms - _newest_ms


async def alike(
    connection: AsyncConnection, provider_id: ProviderId | None, *, heard_since_wall_ms: int
) -> Sequence[AnyRow]:
    """Drones by all that their state depends on: how many, what they have said, how late it came.

    `late_ms` is fleet time from the newest message's moment to when it was heard, added up.
    """
    is_online = func.coalesce(
        and_(
            _known.c.connection_status == "ONLINE",
            _known.c.last_seen_wall_ms >= heard_since_wall_ms,
        ),
        False,
    )
    what = {
        "is_in_maintenance": drones.c.is_in_maintenance,
        "has_connected": _known.c.connection_status.is_not(None),
        "is_online": is_online,
        "activity": _known.c.activity,
        "has_mission": _has_mission,
        "mission_state": _known.c.live_mission_state,
        "names_mission": func.coalesce(_known.c.mission_id == _known.c.live_mission_id, False),
    }
    columns = [column.label(name) for name, column in what.items()]
    query = (
        select(
            *columns,
            func.count().label("drones"),
            func.sum(case((_known.c.state_seq > 0, _known.c.state_seq), else_=0)).label("states"),
            func.sum(case((_known.c.sample_seq > 0, _known.c.sample_seq), else_=0)).label(
                "samples"
            ),
            func.count(_newest_ms).label("heard"),
            func.sum(_late_ms).label("late_ms"),
            func.max(_late_ms).label("latest_ms"),
        )
        .join_from(drones, _known, _known.c.drone_id == drones.c.drone_id)
        .where(literal(True) if provider_id is None else drones.c.provider_id == provider_id)
        .group_by(*columns)
    )
    return (await connection.execute(query)).all()
