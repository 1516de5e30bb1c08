"""The statistics of fleets, and their SQL: the database counts groups of similar drones."""

from collections import Counter
from collections.abc import Sequence
from datetime import datetime
from typing import Annotated, Any, Final

from pydantic import Field
from sqlalchemy import ColumnElement, and_, case, func, literal, or_, select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.message import FleetMoment
from skyway.ids import ProviderId
from skyway.json_model import JsonModel
from skyway.runtime.sql.connection import AnyRow
from skyway.units import ms_to_moment
from skyway_provider_registry.fleets.drone import DroneStateName, state_named
from skyway_provider_registry.presence.store import IS_LAST_MISSION, LAST_MISSION, PRESENCE
from skyway_provider_registry.tables import drones

_NAMES: Final = (
    "is_in_maintenance",
    "has_connected",
    "is_online",
    "activity",
    "has_mission",
    "mission_state",
    "names_mission",
)


class FleetStatistics(JsonModel):
    """All drones now. The lag is the time from sending the newest message to receiving it.

    The growth of `states` and `samples` between two answers is the number of messages in between.
    """

    at: Annotated[FleetMoment, Field(description="moment of the answer, fleet time")]
    drones: Annotated[int, Field(description="number of drones")]
    by_state: Annotated[
        dict[DroneStateName, int], Field(description="number of drones in each state")
    ]
    next_free_at: Annotated[
        FleetMoment | None,
        Field(
            description="the next moment at which a busy drone can begin another mission, fleet "
            "time; null if no drone is busy, or if unknown"
        ),
    ]
    states: Annotated[
        int, Field(description="state messages that drones sent in their present sessions")
    ]
    samples: Annotated[
        int, Field(description="telemetry messages that drones sent in their present sessions")
    ]
    lag_mean_s: Annotated[
        float | None,
        Field(description="mean lag of online drones, wall seconds; null without messages"),
    ]
    lag_max_s: Annotated[
        float | None,
        Field(description="largest lag of online drones, wall seconds; null without messages"),
    ]


def totals(
    rows: Sequence[Any], *, at: datetime, rate: float, next_free_ms: int | None
) -> FleetStatistics:
    """The statistics of these groups of drones. Any: rows of a query."""
    by_state: Counter[DroneStateName] = Counter()
    for row in rows:
        by_state[state_named(**{name: getattr(row, name) for name in _NAMES})] += row.drones
    online = [row for row in rows if row.is_online and row.received]
    received = sum(row.received for row in online)
    late_ms = sum(float(row.late_ms) for row in online)
    latest_ms = max((row.latest_ms for row in online), default=None)
    return FleetStatistics(
        at=at,
        drones=sum(by_state.values()),
        by_state=dict(sorted(by_state.items())),
        next_free_at=None if next_free_ms is None else ms_to_moment(next_free_ms),
        states=sum(int(row.states) for row in rows),
        samples=sum(int(row.samples) for row in rows),
        lag_mean_s=late_ms / received / 1000 / rate if received else None,
        lag_max_s=None if latest_ms is None else latest_ms / 1000 / rate,
    )


_presence = PRESENCE.subquery("drone_presence")

#: On a mission: composition reports so, or the drone does and composition does not contradict.
_has_mission = or_(
    _presence.c.live_mission_id.is_not(None),
    and_(
        _presence.c.mission_id.is_not(None),
        or_(_presence.c.own_mission_is_live.is_(None), _presence.c.own_mission_is_live),
    ),
)
_newest_ms = case(
    (_presence.c.sample_at_ms > _presence.c.state_at_ms, _presence.c.sample_at_ms),
    else_=_presence.c.state_at_ms,
)
_late_ms = _presence.c.last_seen_ms - _newest_ms


async def groups(
    connection: AsyncConnection, provider_id: ProviderId | None, *, received_since_wall_ms: int
) -> Sequence[AnyRow]:
    """Groups of drones whose state is decided alike: their number, messages and lag.

    `late_ms` is the sum, over drones, of the fleet time between sending and receiving the newest
    message.
    """
    is_online = func.coalesce(
        and_(
            _presence.c.connection_status == "ONLINE",
            _presence.c.last_seen_wall_ms >= received_since_wall_ms,
        ),
        False,
    )
    deciding = {
        "is_in_maintenance": drones.c.is_in_maintenance,
        "has_connected": _presence.c.connection_status.is_not(None),
        "is_online": is_online,
        "activity": _presence.c.activity,
        "has_mission": _has_mission,
        "mission_state": _presence.c.live_mission_state,
        "names_mission": func.coalesce(
            _presence.c.mission_id == _presence.c.live_mission_id, False
        ),
    }
    columns = [column.label(name) for name, column in deciding.items()]
    query = (
        select(
            *columns,
            func.count().label("drones"),
            _sum_of_positive(_presence.c.state_seq).label("states"),
            _sum_of_positive(_presence.c.sample_seq).label("samples"),
            func.count(_newest_ms).label("received"),
            func.sum(_late_ms).label("late_ms"),
            func.max(_late_ms).label("latest_ms"),
        )
        .join_from(drones, _presence, _presence.c.drone_id == drones.c.drone_id)
        .where(literal(True) if provider_id is None else drones.c.provider_id == provider_id)
        .group_by(*columns)
    )
    return (await connection.execute(query)).all()


async def next_free_ms(
    connection: AsyncConnection, provider_id: ProviderId | None, *, now_ms: int
) -> int | None:
    """The next moment at which a drone that has missions is free after all of them, if known."""
    query = (
        select(func.min(LAST_MISSION.c.free_ms))
        .join_from(drones, LAST_MISSION, IS_LAST_MISSION)
        .where(LAST_MISSION.c.free_ms > now_ms)
    )
    if provider_id is not None:
        query = query.where(drones.c.provider_id == provider_id)
    found: int | None = (await connection.execute(query)).scalar()
    return found


def _sum_of_positive(column: ColumnElement[int]) -> ColumnElement[int]:
    return func.sum(case((column > 0, column), else_=0))
