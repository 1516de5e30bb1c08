"""All SQL of the occupancy of stations: their pads, and the reservations of each pad."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from sqlalchemy import BigInteger, bindparam, func, literal, select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import MissionId, StationId
from skyway.runtime.sql.in_list import in_list
from skyway_composition.pads.booked_pad import BookedPad
from skyway_composition.pads.occupancy import Occupancy
from skyway_composition.tables import pad_reservations, stations

# Built once, because these statements run every second and building takes longer than running.
_PADS_OF: Final = select(stations.c.station_id, stations.c.pads).where(
    in_list(stations.c.station_id, "station_ids")
)
# The database counts, because many missions in flight have many rows at few stations.
_IS_BEGUN: Final = pad_reservations.c.start_ms <= bindparam("at_ms")
_IS_TAKEN: Final = _IS_BEGUN & (pad_reservations.c.pad < stations.c.pads)
_USED: Final = (
    select(
        stations.c.station_id,
        stations.c.pads,
        func.count().filter(_IS_TAKEN),
        func.count().filter(~_IS_BEGUN),
        func.min(pad_reservations.c.end_ms).filter(_IS_TAKEN),
    )
    .join_from(pad_reservations, stations, stations.c.station_id == pad_reservations.c.station_id)
    .where(pad_reservations.c.end_ms > bindparam("at_ms"))
    .group_by(stations.c.station_id, stations.c.pads)
)


@dataclass(frozen=True, slots=True)
class Reservation:
    """A reserved pad and the mission that holds it."""

    booked: BookedPad
    mission_id: MissionId


async def pads_of(connection: AsyncConnection, station_id: StationId) -> int | None:
    """The number of pads of a station; None when there is no such station."""
    found = await connection.execute(
        select(stations.c.pads).where(stations.c.station_id == station_id)
    )
    pads: int | None = found.scalar_one_or_none()
    return pads


async def reservations_of(
    connection: AsyncConnection,
    station_id: StationId,
    *,
    ending_after_ms: int,
    after: tuple[int, int] | None,
    limit: int,
) -> list[Reservation]:
    """A station's reservations in order of (start, pad), after a given one."""
    query = (
        select(pad_reservations)
        .where(
            pad_reservations.c.station_id == station_id,
            pad_reservations.c.end_ms > ending_after_ms,
        )
        .order_by(pad_reservations.c.start_ms, pad_reservations.c.pad)
        .limit(limit)
    )
    if after is not None:
        start_ms = after[0]
        pad = literal(after[1], BigInteger)  # an invented cursor may exceed any pad's number
        query = query.where(
            (pad_reservations.c.start_ms > start_ms)
            | ((pad_reservations.c.start_ms == start_ms) & (pad_reservations.c.pad > pad))
        )
    found = await connection.execute(query)
    return [
        Reservation(BookedPad(row.station_id, row.pad, row.start_ms, row.end_ms), row.mission_id)
        for row in found
    ]


async def used_stations(connection: AsyncConnection, *, at_ms: int) -> dict[StationId, Occupancy]:
    """The occupancy of each station that has a reservation now or later."""
    found = await connection.execute(_USED, {"at_ms": at_ms})
    return {station_id: Occupancy(*use) for station_id, *use in found}


async def pads_of_all(
    connection: AsyncConnection, station_ids: Sequence[StationId]
) -> dict[StationId, int]:
    """The number of pads of these stations."""
    found = await connection.execute(_PADS_OF, {"station_ids": station_ids})
    return {row.station_id: row.pads for row in found}


async def pads_everywhere(connection: AsyncConnection) -> dict[StationId, int]:
    """The number of pads of every station."""
    found = await connection.execute(select(stations.c.station_id, stations.c.pads))
    return {row.station_id: row.pads for row in found}
