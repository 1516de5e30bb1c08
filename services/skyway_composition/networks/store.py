"""All SQL of the networks."""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final

from sqlalchemy import ColumnElement, Row, bindparam, delete, func, insert, select, true, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.geo import Position
from skyway.ids import NetworkId, StationId
from skyway.network.network import Station
from skyway.runtime.sql.among import among
from skyway.runtime.sql.database import Tx
from skyway_composition.networks.box import Box
from skyway_composition.tables import network_versions, networks, pad_reservations, stations

# Statements that each booking needs: making them takes longer than running them does.
_CURRENT: Final = select(networks).where(networks.c.network_id == bindparam("of_network"))
_ALL_CURRENT: Final = select(networks).order_by(networks.c.network_id)
_SHARE: Final = (
    select(networks.c.version, networks.c.conditions)
    .where(networks.c.network_id == bindparam("of_network"))
    .with_for_update(read=True)
)
_PRESENT_AROUND: Final = (
    select(networks.c.network_id, networks.c.version, networks.c.conditions)
    .join(stations, stations.c.network_id == networks.c.network_id)
    .where(stations.c.station_id == bindparam("of_station"))
)
_NETWORK_OF: Final = select(stations.c.network_id).where(
    stations.c.station_id == bindparam("of_station")
)
_STATIONS_NAMED: Final = select(stations).where(among(stations.c.station_id, "station_ids"))


@dataclass(frozen=True, slots=True)
class VersionRow:
    """A version of a network, without its content."""

    network_id: NetworkId
    version: int
    sha256: str
    published_ms: int


@dataclass(frozen=True, slots=True)
class Present:
    """A network as it is now: its version, and the number of its conditions."""

    network_id: NetworkId
    version: int
    conditions: int


@dataclass(frozen=True, slots=True)
class StationRow:
    """A station of a current version."""

    station_id: StationId
    network_id: NetworkId
    name: str | None
    pads: int
    position: Position


async def current_version(connection: AsyncConnection, network_id: NetworkId) -> VersionRow | None:
    """The current version of a network."""
    found = await connection.execute(_CURRENT, {"of_network": network_id})
    row = found.one_or_none()
    return None if row is None else _version_row(row)


async def lock_version(tx: Tx, network_id: NetworkId) -> VersionRow | None:
    """The current version, which nobody can replace before this transaction ends."""
    found = await tx.execute(
        select(networks).where(networks.c.network_id == network_id).with_for_update()
    )
    row = found.one_or_none()
    return None if row is None else _version_row(row)


async def share_world(tx: Tx, network_id: NetworkId) -> tuple[int, int] | None:
    """The current version and the number of its conditions; others may read them too.

    Nobody publishes, closes or reopens anything in this network before the transaction ends.
    """
    found = await tx.execute(_SHARE, {"of_network": network_id})
    row = found.one_or_none()
    return None if row is None else (row.version, row.conditions)


async def all_current(connection: AsyncConnection) -> list[VersionRow]:
    """The current versions of all networks."""
    found = await connection.execute(_ALL_CURRENT)
    return [_version_row(row) for row in found]


async def current_after(
    connection: AsyncConnection, network_id: str, *, limit: int
) -> list[VersionRow]:
    """The current versions of the networks that follow this id."""
    found = await connection.execute(
        select(networks)
        .where(networks.c.network_id > network_id)
        .order_by(networks.c.network_id)
        .limit(limit)
    )
    return [_version_row(row) for row in found]


async def versions_before(
    connection: AsyncConnection, network_id: NetworkId, *, before: int, limit: int
) -> list[VersionRow]:
    """The versions of a network below `before`, newest first."""
    found = await connection.execute(
        select(
            network_versions.c.network_id,
            network_versions.c.version,
            network_versions.c.sha256,
            network_versions.c.published_ms,
        )
        .where(network_versions.c.network_id == network_id, network_versions.c.version < before)
        .order_by(network_versions.c.version.desc())
        .limit(limit)
    )
    return [_version_row(row) for row in found]


async def content(connection: AsyncConnection, network_id: NetworkId, version: int) -> bytes | None:
    """The GeoJSON of a version."""
    found = await connection.execute(
        select(network_versions.c.content).where(
            network_versions.c.network_id == network_id, network_versions.c.version == version
        )
    )
    stored: bytes | None = found.scalar_one_or_none()
    return stored


async def network_of(connection: AsyncConnection, station_id: StationId) -> NetworkId | None:
    """The network that has this station now."""
    found = await connection.execute(_NETWORK_OF, {"of_station": station_id})
    network_id: NetworkId | None = found.scalar_one_or_none()
    return network_id


async def present_around(connection: AsyncConnection, station_id: StationId) -> Present | None:
    """The network that has this station now, as it is at one moment."""
    found = await connection.execute(_PRESENT_AROUND, {"of_station": station_id})
    row = found.one_or_none()
    return None if row is None else Present(*row)


async def stations_named(
    connection: AsyncConnection, station_ids: Collection[StationId]
) -> dict[StationId, StationRow]:
    """Those of the named stations that exist."""
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
    """The stations of a network that follow this id, all or those in a box."""
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
    """Those of these stations that another network has, at most ten."""
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
    """How many pads each station must keep: one more than its highest reserved pad."""
    found = await tx.execute(
        select(pad_reservations.c.station_id, (func.max(pad_reservations.c.pad) + 1).label("pads"))
        .join(stations, stations.c.station_id == pad_reservations.c.station_id)
        .where(stations.c.network_id == network_id)
        .group_by(pad_reservations.c.station_id)
    )
    return {row.station_id: row.pads for row in found}


async def add_version(
    tx: Tx, row: VersionRow, *, content: bytes, of_stations: Iterable[Station]
) -> None:
    """Make this the current version, with its stations."""
    values = {
        "version": row.version,
        "sha256": row.sha256,
        "published_ms": row.published_ms,
    }
    if row.version == 1:
        await tx.execute(insert(networks).values(network_id=row.network_id, **values))
    else:
        await tx.execute(
            update(networks).where(networks.c.network_id == row.network_id).values(values)
        )
    await tx.execute(
        insert(network_versions).values(network_id=row.network_id, content=content, **values)
    )
    await tx.execute(delete(stations).where(stations.c.network_id == row.network_id))
    added = [
        {
            "station_id": station.station_id,
            "network_id": row.network_id,
            "name": station.name,
            "pads": station.pads,
            "longitude_deg": station.position.longitude_deg,
            "latitude_deg": station.position.latitude_deg,
        }
        for station in of_stations
    ]
    if added:
        await tx.execute(insert(stations), added)


def _parts(station_ids: Sequence[StationId]) -> Iterable[Sequence[StationId]]:
    # Drivers limit the parameters of one statement: 32,766 on SQLite.
    return (station_ids[start : start + 10_000] for start in range(0, len(station_ids), 10_000))


def _version_row(row: Row[*tuple[Any, ...]]) -> VersionRow:
    return VersionRow(row.network_id, row.version, row.sha256, row.published_ms)


def _lies_in(box: Box) -> ColumnElement[bool]:
    (west, south), (east, north) = box.south_west, box.north_east
    is_east, is_west = stations.c.longitude_deg >= west, stations.c.longitude_deg <= east
    return stations.c.latitude_deg.between(south, north) & (
        (is_east | is_west) if box.crosses_date_line else (is_east & is_west)
    )


def _station_row(row: Row[*tuple[Any, ...]]) -> StationRow:
    position = Position(row.longitude_deg, row.latitude_deg)
    return StationRow(row.station_id, row.network_id, row.name, row.pads, position)
