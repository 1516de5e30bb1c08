"""All SQL of the stations of current versions, and the box on the map that selects stations."""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final, Self

from pydantic import TypeAdapter
from sqlalchemy import ColumnElement, Row, bindparam, delete, func, insert, select, true
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.geo import Position
from skyway.ids import NetworkId, StationId
from skyway.network.network import Station
from skyway.runtime.sql.database import Tx
from skyway.runtime.sql.in_list import in_list
from skyway_composition.tables import pad_reservations, stations

_CORNER: Final[TypeAdapter[Position]] = TypeAdapter(Position)

# Built once, because many requests run these statements and building takes longer than running.
_NETWORK_OF: Final = select(stations.c.network_id).where(
    stations.c.station_id == bindparam("of_station")
)

_STATIONS_NAMED: Final = select(stations).where(in_list(stations.c.station_id, "station_ids"))


@dataclass(frozen=True, slots=True)
class Box:
    """An area between two meridians and two parallels.

    When the box crosses the date line, its south-west corner has the larger longitude.
    """

    south_west: Position
    north_east: Position

    @classmethod
    def parse(cls, text: str) -> Self:
        """The box in ``west,south,east,north``, in degrees, as GeoJSON orders a `bbox`.

        Raises
        ------
        ValueError
            The text is not four such numbers, or south lies north of north.
        """
        try:
            west, south, east, north = map(float, text.split(","))
            box = cls(
                _CORNER.validate_python((west, south)), _CORNER.validate_python((east, north))
            )
        except ValueError as error:
            raise ValueError("must be west,south,east,north in degrees") from error
        if box.south_west.latitude_deg > box.north_east.latitude_deg:
            raise ValueError("south must not lie north of north")
        return box

    @property
    def crosses_date_line(self) -> bool:
        """Whether the box contains a part of the 180th meridian."""
        return self.south_west.longitude_deg > self.north_east.longitude_deg


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
    (west, south), (east, north) = box.south_west, box.north_east
    is_east, is_west = stations.c.longitude_deg >= west, stations.c.longitude_deg <= east
    return stations.c.latitude_deg.between(south, north) & (
        (is_east | is_west) if box.crosses_date_line else (is_east & is_west)
    )


def _station_row(row: Row[*tuple[Any, ...]]) -> StationRow:
    position = Position(row.longitude_deg, row.latitude_deg)
    return StationRow(row.station_id, row.network_id, row.name, row.pads, position)
