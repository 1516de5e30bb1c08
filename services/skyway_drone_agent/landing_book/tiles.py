"""The map in small tiles: the tiles around a flight, and their bounding box."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, NamedTuple

from skyway.geo import EARTH_RADIUS_M, Position

#: A tile's sides, degrees: 5.6 km from south to north, less from west to east.
TILE_DEG: Final = 0.05

_COLUMNS: Final = round(360 / TILE_DEG)
_ROWS: Final = round(180 / TILE_DEG)

#: Tiles by which the surroundings are larger than the flight: about 10 km.
_BEYOND: Final = 2

#: The most such tiles to the east and west, enough up to latitude 88: tiles are narrow there.
_MOST_BEYOND: Final = 60

#: Degrees by which boxes are larger than their tiles, so that rounding loses no station.
_ROUNDING_DEG: Final = 1e-6


class Tile(NamedTuple):
    """A tile; columns count east from the date line, rows north from the south pole."""

    column: int
    row: int


def tile_of(position: Position) -> Tile:
    """The tile that holds a position."""
    column = math.floor((position.longitude_deg + 180.0) / TILE_DEG) % _COLUMNS
    return Tile(column, math.floor((position.latitude_deg + 90.0) / TILE_DEG))


def narrowing_at(latitude_deg: float) -> float:
    """How narrow a tile is there, as a share of its height; not less than is searched."""
    return max(math.cos(math.radians(latitude_deg)), _BEYOND / _MOST_BEYOND)


def ring(here: Position, distance: int) -> Iterator[Tile]:
    """The tiles at this many steps from that of a place: its own at 0, then those around it.

    A step to the east or west is as many tiles as a step to the north is long.
    """
    middle, wide = tile_of(here), math.ceil(1 / narrowing_at(here.latitude_deg))
    inner, outer = (distance - 1) * wide, distance * wide
    for north in range(-distance, distance + 1):
        for east in range(-outer, outer + 1):
            if abs(north) == distance or abs(east) > inner:
                yield Tile((middle.column + east) % _COLUMNS, middle.row + north)


def covered_m(here: Position, distance: int) -> float:
    """The radius that the rings up to this one cover."""
    east = (here.longitude_deg + 180.0) % TILE_DEG
    north = (here.latitude_deg + 90.0) % TILE_DEG
    narrowing = math.cos(math.radians(abs(here.latitude_deg) + distance * TILE_DEG))
    wide = distance * math.ceil(1 / narrowing_at(here.latitude_deg))
    beside = (min(east, TILE_DEG - east) + wide * TILE_DEG) * max(narrowing, 0.0)
    above = min(north, TILE_DEG - north) + distance * TILE_DEG
    return math.radians(min(beside, above)) * EARTH_RADIUS_M


@dataclass(frozen=True, slots=True)
class TileBox:
    """A rectangle of tiles, which may cross the date line."""

    west: int
    south: int
    columns: int
    rows: int

    @classmethod
    def around(cls, start: Position, end: Position) -> "TileBox":
        """The box around a flight between two positions, the short way round the globe."""
        first, last = tile_of(start), tile_of(end)
        eastwards = (last.column - first.column) % _COLUMNS
        west = first.column
        if eastwards > _COLUMNS // 2:
            eastwards, west = _COLUMNS - eastwards, last.column
        furthest_deg = max(abs(start.latitude_deg), abs(end.latitude_deg))
        beyond = math.ceil(_BEYOND / narrowing_at(furthest_deg))
        south = max(0, min(first.row, last.row) - _BEYOND)
        north = min(_ROWS - 1, max(first.row, last.row) + _BEYOND)
        return cls(
            west=(west - beyond) % _COLUMNS,
            south=south,
            columns=min(_COLUMNS, eastwards + 1 + 2 * beyond),
            rows=north - south + 1,
        )

    @property
    def tiles(self) -> tuple[Tile, ...]:
        """All tiles, row by row."""
        return tuple(
            Tile((self.west + east) % _COLUMNS, self.south + north)
            for north in range(self.rows)
            for east in range(self.columns)
        )

    @property
    def bbox(self) -> str:
        """``west,south,east,north`` in degrees, as the cloud's API expects it."""
        east = self.west + self.columns
        if self.columns >= _COLUMNS:
            west_deg, east_deg = -180.0, 180.0
        else:
            west_deg = self.west * TILE_DEG - 180.0 - _ROUNDING_DEG
            east_deg = (east % _COLUMNS or _COLUMNS) * TILE_DEG - 180.0 + _ROUNDING_DEG
        south_deg = self.south * TILE_DEG - 90.0 - _ROUNDING_DEG
        north_deg = (self.south + self.rows) * TILE_DEG - 90.0 + _ROUNDING_DEG
        corners = (
            max(-180.0, west_deg),
            max(-90.0, south_deg),
            min(180.0, east_deg),
            min(90.0, north_deg),
        )
        return ",".join(f"{degrees:.6f}" for degrees in corners)
