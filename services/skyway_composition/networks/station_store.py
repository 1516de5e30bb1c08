"""All SQL of the stations of current versions, and the box on the map that selects stations."""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final

from sqlalchemy import ColumnElement, Row, bindparam, delete, func, insert, select, true
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.geo import Box, Position
from skyway.ids import NetworkId, StationId
from skyway.network.network import Station
from skyway.runtime.sql.database import Tx
from skyway.runtime.sql.in_list import in_list
from skyway_composition.tables import pad_reservations, stations

# Built once, because many requests run these statements and building takes longer than running.
_NETWORK_OF: Final = select(stations.c.network_id).where(
    stations.c.station_id == bindparam("of_station")
)

_STATIONS_NAMED: Final = select(stations).where(in_list(stations.c.station_id, "station_ids"))


@dataclass(frozen=True, slots=True)
class StationRow:
    """A station of a current version."""

    station_id: StationId
    network_id: NetworkId
    name: str | None
    pads: int
    position: Position


async def network_of(connection: AsyncConnection, station_id: StationId) -> NetworkId | None:
    """The network whose current version has this station; None for no network."""
    found = await connection.execute(_NETWORK_OF, {"of_station": station_id})
    network_id: NetworkId | None = found.scalar_one_or_none()
    return network_id


async def stations_named(
    connection: AsyncConnection, station_ids: Collection[StationId]
) -> dict[StationId, StationRow]:
    """The stations with these ids, by id; an unknown station is left out."""
    found = await connection.execute(_STATIONS_NAMED, {"station_ids": [*station_ids]})
    return {row.station_id: _station_row(row) for row in found}


async def stations_after(
    connection: AsyncConnection,
    network_id: NetworkId,
    station_id: str,
    *,
    box: Box | None,
    limit: int,
) -> list[StationRow]:
    """The stations of a network whose ids follow this id, all stations or those in a box."""
    found = await connection.execute(
        select(stations)
        .where(stations.c.network_id == network_id, stations.c.station_id > station_id)
        .where(true() if box is None else _lies_in(box))
        .order_by(stations.c.station_id)
        .limit(limit)
    )
    return [_station_row(row) for row in found]


async def stations_elsewhere(
    tx: Tx, network_id: NetworkId, station_ids: Sequence[StationId]
) -> list[StationRow]:
    """At most ten of these stations that belong to another network."""
    elsewhere: list[StationRow] = []
    for part in _parts(station_ids):
        found = await tx.execute(
            select(stations)
            .where(stations.c.network_id != network_id, stations.c.station_id.in_(part))
            .order_by(stations.c.station_id)
            .limit(10)
        )
        elsewhere.extend(_station_row(row) for row in found)
    return elsewhere[:10]


async def reserved_pads(tx: Tx, network_id: NetworkId) -> dict[StationId, int]:
    """How many pads each station must keep: one more than the number of its last reserved pad."""
    found = await tx.execute(
        select(pad_reservations.c.station_id, (func.max(pad_reservations.c.pad) + 1).label("pads"))
        .join(stations, stations.c.station_id == pad_reservations.c.station_id)
        # Held offers are planned again for the new network, so their pads may go.
        .where(stations.c.network_id == network_id, pad_reservations.c.hold_id.is_(None))
        .group_by(pad_reservations.c.station_id)
    )
    return {row.station_id: row.pads for row in found}


async def replace_stations(tx: Tx, network_id: NetworkId, present: Iterable[Station]) -> None:
    """Replace all stations of a network by these."""
    await tx.execute(delete(stations).where(stations.c.network_id == network_id))
    added = [
        {
            "station_id": station.station_id,
            "network_id": network_id,
            "name": station.name,
            "pads": station.pads,
            "longitude_deg": station.position.longitude_deg,
            "latitude_deg": station.position.latitude_deg,
        }
        for station in present
    ]
    if added:
        await tx.execute(insert(stations), added)


def _parts(station_ids: Sequence[StationId]) -> Iterable[Sequence[StationId]]:
    # Drivers limit the parameters of one statement: 32,766 on SQLite.
    return (station_ids[start : start + 10_000] for start in range(0, len(station_ids), 10_000))


def _lies_in(box: Box) -> ColumnElement[bool]:
    longitude_deg = stations.c.longitude_deg
    is_east, is_west = longitude_deg >= box.west, longitude_deg <= box.east
    is_between = (is_east | is_west) if box.west > box.east else (is_east & is_west)
    # 180 and -180 are the same meridian.
    edges = [-each for each in (box.west, box.east) if abs(each) == 180.0]
    return stations.c.latitude_deg.between(box.south, box.north) & (
        is_between | longitude_deg.in_(edges)
    )


def _station_row(row: Row[*tuple[Any, ...]]) -> StationRow:
    position = Position(row.longitude_deg, row.latitude_deg)
    return StationRow(row.station_id, row.network_id, row.name, row.pads, position)
