"""All SQL that finds standbys which may give way to another drone's service."""

from collections.abc import Collection, Sequence
from itertools import groupby
from typing import Final

from sqlalchemy import BigInteger, and_, bindparam, exists, func, literal_column, or_, select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.drone_report import Connection
from skyway.ids import DroneId, MissionId, StationId
from skyway.runtime.sql.connection import AnyRow
from skyway.runtime.sql.in_list import in_list
from skyway.scheduling.giving_way import YieldingStandby
from skyway.scheduling.stays import read_stays
from skyway.scheduling.trip import BookedPad
from skyway_composition.tables import (
    drone_links,
    is_queued,
    is_under_way,
    missions,
    pad_reservations,
)

_later = missions.alias("later")

#: A mission gives nothing up while its plan is in question, while a package may go elsewhere, and
#: while another mission or a held offer begins behind it.
_YIELDING: Final = (
    select(
        missions.c.mission_id,
        missions.c.drone_id,
        missions.c.state,
        missions.c.stays,
        drone_links.c.connection,
        drone_links.c.calendar_version,
        pad_reservations.c.station_id,
        pad_reservations.c.pad,
        pad_reservations.c.start_ms.label("from_ms"),
        pad_reservations.c.end_ms.label("until_ms"),
    )
    .join(drone_links, drone_links.c.drone_id == missions.c.drone_id)
    .join(pad_reservations, pad_reservations.c.mission_id == missions.c.mission_id)
    .where(
        in_list(missions.c.mission_id, "mission_ids"),
        or_(is_queued, is_under_way),
        missions.c.stays.is_not(None),
        missions.c.stuck.is_(None),
        missions.c.trouble.is_(None),
        missions.c.proposal.is_(None),
        missions.c.aims == "[]",
        func.coalesce(drone_links.c.held_until_ms, 0) <= bindparam("now_ms", type_=BigInteger),
        ~exists().where(
            and_(
                _later.c.drone_id == missions.c.drone_id,
                _later.c.state == literal_column("'QUEUED'"),
                _later.c.start_ms > missions.c.start_ms,
            )
        ),
    )
    .order_by(missions.c.drone_id, pad_reservations.c.start_ms)
)

_UNANSWERED: Final = select(missions.c.mission_id).where(
    in_list(missions.c.mission_id, "mission_ids"), missions.c.proposal.is_not(None)
)


async def yielding_standbys(
    connection: AsyncConnection, mission_ids: Collection[str], *, now_ms: int
) -> list[YieldingStandby]:
    """The standbys of these missions that may give way, in the order of their drones.

    The standby of a drone that is known to be offline is left out: it could not accept another one.
    """
    values = {"mission_ids": [*mission_ids], "now_ms": now_ms}
    found = await connection.execute(_YIELDING, values)
    by_mission = [[*rows] for _, rows in groupby(found.all(), key=lambda row: row.mission_id)]
    return [
        _standby(rows)
        for rows in by_mission
        if rows[0].state == "QUEUED" or not _is_offline(rows[0].connection)
    ]


def _is_offline(connection: str | None) -> bool:
    return connection is not None and Connection.read(connection).status != "ONLINE"


def _standby(rows: Sequence[AnyRow]) -> YieldingStandby:
    """The standby of a mission in its rows, one for each pad."""
    mission = rows[0]
    return YieldingStandby(
        mission_id=MissionId(mission.mission_id),
        drone_id=DroneId(mission.drone_id),
        stays=read_stays(mission.stays),
        pads=tuple(
            BookedPad(StationId(row.station_id), row.pad, row.from_ms, row.until_ms) for row in rows
        ),
        is_sent=mission.state != "QUEUED",
        calendar_version=mission.calendar_version,
    )


async def unanswered(connection: AsyncConnection, mission_ids: Collection[MissionId]) -> bool:
    """Whether the drone of one of these missions has not answered a proposal yet."""
    found = await connection.execute(_UNANSWERED, {"mission_ids": [*mission_ids]})
    return found.first() is not None
