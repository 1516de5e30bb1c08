"""Alarms: problems that an operator must look at and acknowledge, with all their SQL."""

import json
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Any, Final, Literal, get_args

from pydantic import Field
from sqlalchemy import (
    ColumnElement,
    Row,
    and_,
    delete,
    exists,
    func,
    insert,
    or_,
    select,
    update,
)
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.business_faults import BusinessFault, BusinessFaultCode
from skyway.contracts.drone_report import AlarmLevel
from skyway.ids import AlarmId, DroneId, MissionId, ProviderId, StationId
from skyway.json_model import JsonModel
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Tx
from skyway.units import ms_to_moment
from skyway_composition.tables import alarms, missions
from skyway_composition.tables import is_open as is_mission_open
from skyway_composition.tables.missions import DAY_MS

AlarmState = Literal["OPEN", "ACKNOWLEDGED"]

#: The most open alarms of one level about a drone, and about the drones of one provider, up to
#: which a drone raises others itself. Our own choice.
MOST_OPEN_OF_DRONE: Final = 50
MOST_OPEN_OF_PROVIDER: Final = 1_000

#: Who acknowledges an alarm whose cause has passed.
_ENDED_BY: Final = "service:composition"

#: The alarms that one transaction deletes at most.
_DELETED_TOGETHER: Final = 500


class Alarm(JsonModel):
    """A problem that an operator must look at."""

    alarm_id: Annotated[AlarmId, Field(description="Id of the alarm.")]
    level: Annotated[
        AlarmLevel, Field(description="How serious the problem is: WARNING, URGENT or CRITICAL.")
    ]
    code: Annotated[str, Field(description="Stable reason for programs.", examples=["BATTERY_LOW"])]
    detail: Annotated[str, Field(description="The reason in words, with the values in question.")]
    at: Annotated[datetime, Field(description="Moment of the problem, fleet time.")]
    state: Annotated[
        AlarmState,
        Field(
            description="OPEN until an operator acknowledges the alarm, or what it says is over."
        ),
    ]
    provider_id: Annotated[
        ProviderId | None, Field(description="Provider that the problem concerns, if any.")
    ]
    drone_id: Annotated[
        DroneId | None, Field(description="Drone that the problem concerns, if any.")
    ]
    mission_id: Annotated[
        MissionId | None, Field(description="Mission that the problem concerns, if any.")
    ]
    station_id: Annotated[
        StationId | None, Field(description="Station that the problem concerns, if any.")
    ]
    data: dict[str, Any] = Field(
        default_factory=dict,
        description="Numbers and names behind the code, such as need_j and have_j.",
        examples=[{"need_j": 512_000.0, "have_j": 430_000.0}],
    )
    acknowledged_at: Annotated[
        datetime | None, Field(description="Moment of the acknowledgement, fleet time.")
    ] = None
    acknowledged_by: Annotated[
        str | None,
        Field(
            description="The operator who acknowledged the alarm first; service:composition if "
            "what it says was over first."
        ),
    ] = None
    note: Annotated[str | None, Field(description="What this operator wrote about the alarm.")] = (
        None
    )


@dataclass(frozen=True, slots=True)
class AlarmFilter:
    """Which alarms a list shows; None means no filter. `before_ms` itself is not in the span."""

    provider_id: str | None = None
    state: AlarmState | None = None
    level: AlarmLevel | None = None
    since_ms: int | None = None
    before_ms: int | None = None


async def add(
    tx: Tx,
    *,
    level: AlarmLevel,
    code: str,
    detail: str,
    at_ms: int,
    mint: Mint,
    provider_id: ProviderId | None = None,
    drone_id: DroneId | None = None,
    mission_id: MissionId | None = None,
    station_id: StationId | None = None,
    data: Mapping[str, Any] | None = None,  # numbers and names behind the code
) -> AlarmId:
    """Raise an alarm; it stays open until an operator acknowledges it, or `end` ends it."""
    alarm_id = AlarmId(mint("alm"))
    await tx.execute(
        insert(alarms).values(
            alarm_id=alarm_id,
            level=level,
            code=code,
            detail=detail,
            at_ms=at_ms,
            provider_id=provider_id,
            drone_id=drone_id,
            mission_id=mission_id,
            station_id=station_id,
            data=json.dumps(data or {}),
        )
    )
    return alarm_id


#: Alarms that end by themselves, with what their missions had as long as they stood: a mission in
#: doubt, a mission that needs another plan. docs/reference/operations.md says why no others do.
OF_DOUBT: Final = frozenset({"MISSION_IN_DOUBT"})
OF_TROUBLE: Final = frozenset({"REVISIONS_REFUSED", "DIVERSION_IMPOSSIBLE", "FAILSAFE_ACTIVE"})
#: Alarms about no mission, which end at the look that finds nothing.
OF_SYSTEM: Final = frozenset({"MISSIONS_UNKNOWN"})
#: Alarms of the registry, which says when they end.
OF_REGISTRY: Final = frozenset({"MAINTENANCE_DUE"})
#: Alarms about settings with which a provider gets no deliveries. The registry names them all.
OF_BUSINESS: Final[frozenset[str]] = frozenset(get_args(BusinessFaultCode))


async def end(
    tx: Tx, codes: Collection[str], *, about: tuple[DroneId | None, MissionId | None], at_ms: int
) -> None:
    """End the open alarms with these codes about a drone and its mission, or about none.

    What they say is over.
    """
    drone_id, mission_id = about
    await tx.execute(
        update(alarms)
        .where(
            alarms.c.acknowledged_ms.is_(None),
            alarms.c.drone_id.is_not_distinct_from(drone_id),
            alarms.c.mission_id.is_not_distinct_from(mission_id),
            alarms.c.code.in_(sorted(codes)),
        )
        .values(_ended(at_ms))
    )


def _ended(at_ms: int) -> dict[str, int | str]:
    """The columns of an alarm that has ended by itself."""
    note = "this is over; the alarm has ended by itself"
    return {"acknowledged_ms": at_ms, "acknowledged_by": _ENDED_BY, "note": note}


async def set_business_faults(
    tx: Tx, faults: Iterable[BusinessFault], *, at_ms: int, mint: Mint
) -> None:
    """Raise an alarm for each new fault, and end the alarms about faults that are mended.

    A person who acknowledges such an alarm is reminded after a day of fleet time.
    """
    is_open = alarms.c.acknowledged_ms.is_(None)
    is_by_person = alarms.c.acknowledged_by != _ENDED_BY
    # A drone that raises alarms chooses their codes, but those name the drone.
    found = await tx.execute(
        select(alarms).where(
            alarms.c.drone_id.is_(None),
            alarms.c.code.in_(sorted(OF_BUSINESS)),
            or_(is_open, and_(is_by_person, alarms.c.acknowledged_ms > at_ms - DAY_MS)),
        )
    )
    present = {(each.provider_id, each.code, each.detail): each for each in found}
    wanted = {(each.provider_id, each.code, each.detail): each for each in faults}
    for what, alarm in present.items():
        if what not in wanted and alarm.acknowledged_ms is None:
            this = alarms.c.alarm_id == alarm.alarm_id
            await tx.execute(update(alarms).where(this).values(_ended(at_ms)))
    for what, fault in wanted.items():
        if what not in present:
            await add(
                tx,
                level="WARNING",
                code=fault.code,
                detail=fault.detail,
                at_ms=at_ms,
                mint=mint,
                provider_id=fault.provider_id,
                data={"network_id": fault.network_id},
            )


async def has_room(
    connection: AsyncConnection, provider_id: ProviderId, drone_id: DroneId, level: AlarmLevel
) -> bool:
    """Whether a drone may raise another alarm of this level itself.

    Neither a drone that raises alarm after alarm nor a provider with many such drones may hide the
    alarms of others, or fill the disk.
    """
    of_drone, of_provider = alarms.c.drone_id == drone_id, alarms.c.provider_id == provider_id
    return await _are_fewer_open(
        connection, of_drone, level=level, than=MOST_OPEN_OF_DRONE
    ) and await _are_fewer_open(connection, of_provider, level=level, than=MOST_OPEN_OF_PROVIDER)


async def _are_fewer_open(
    connection: AsyncConnection, which: ColumnElement[bool], *, level: AlarmLevel, than: int
) -> bool:
    open_ones = (
        select(alarms.c.alarm_id)
        .where(alarms.c.acknowledged_ms.is_(None), which, alarms.c.level == level)
        .limit(than)
        .subquery()
    )
    found = await connection.execute(select(func.count()).select_from(open_ones))
    return int(found.scalar_one()) < than


async def is_open(connection: AsyncConnection, drone_id: DroneId | None, *, code: str) -> bool:
    """Whether an alarm with this code about this drone, or about none, is not acknowledged yet."""
    query = select(alarms.c.alarm_id).where(
        alarms.c.acknowledged_ms.is_(None), alarms.c.drone_id == drone_id, alarms.c.code == code
    )
    return (await connection.execute(query.limit(1))).first() is not None


async def acknowledge(
    tx: Tx, alarm_id: AlarmId, *, by: str, at_ms: int, note: str | None
) -> Alarm | None:
    """Acknowledge an alarm and return it; None when there is no such alarm.

    An alarm that was acknowledged before keeps its first acknowledgement.
    """
    this = alarms.c.alarm_id == alarm_id
    await tx.execute(
        update(alarms)
        .where(this, alarms.c.acknowledged_ms.is_(None))
        .values(acknowledged_ms=at_ms, acknowledged_by=by, note=note)
    )
    row = (await tx.execute(select(alarms).where(this))).one_or_none()
    return None if row is None else _alarm(row)


async def page(
    connection: AsyncConnection, shown: AlarmFilter, *, before: str | None, limit: int
) -> list[Alarm]:
    """Alarms whose id comes before a given one, the newest first."""
    query = select(alarms).order_by(alarms.c.alarm_id.desc()).limit(limit)
    if shown.provider_id is not None:
        query = query.where(alarms.c.provider_id == shown.provider_id)
    if shown.level is not None:
        query = query.where(alarms.c.level == shown.level)
    if shown.state is not None:
        is_open = alarms.c.acknowledged_ms.is_(None)
        query = query.where(is_open if shown.state == "OPEN" else ~is_open)
    if shown.since_ms is not None:
        query = query.where(alarms.c.at_ms >= shown.since_ms)
    if shown.before_ms is not None:
        query = query.where(alarms.c.at_ms < shown.before_ms)
    if before is not None:
        query = query.where(alarms.c.alarm_id < before)
    return [_alarm(row) for row in await connection.execute(query)]


async def delete_acknowledged(tx: Tx, *, before_ms: int) -> bool:
    """Delete some alarms that were acknowledged before this fleet time; whether there may be more.

    A mission that is not over keeps its alarms.
    """
    has_open_mission = exists().where(missions.c.mission_id == alarms.c.mission_id, is_mission_open)
    some = (
        select(alarms.c.alarm_id)
        .where(alarms.c.acknowledged_ms < before_ms, ~has_open_mission)
        .limit(_DELETED_TOGETHER)
    )
    deleted = await tx.execute(delete(alarms).where(alarms.c.alarm_id.in_(some)))
    return deleted.rowcount == _DELETED_TOGETHER


def _alarm(row: Row[*tuple[Any, ...]]) -> Alarm:  # a row of alarms
    acknowledged_ms = row.acknowledged_ms
    return Alarm(
        alarm_id=row.alarm_id,
        level=row.level,
        code=row.code,
        detail=row.detail,
        at=ms_to_moment(row.at_ms),
        state="OPEN" if acknowledged_ms is None else "ACKNOWLEDGED",
        provider_id=row.provider_id,
        drone_id=row.drone_id,
        mission_id=row.mission_id,
        station_id=row.station_id,
        data=json.loads(row.data),
        acknowledged_at=None if acknowledged_ms is None else ms_to_moment(acknowledged_ms),
        acknowledged_by=row.acknowledged_by,
        note=row.note,
    )
