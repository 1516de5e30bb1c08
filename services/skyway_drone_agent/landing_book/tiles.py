"""The map in small tiles: the tiles around a flight, and their bounding box."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, NamedTuple

from skyway.geo import Position

#: A tile's sides, degrees: 5.6 km from south to north, less from west to east.
TILE_DEG: Final = 0.05

_COLUMNS: Final = round(360 / TILE_DEG)
_ROWS: Final = round(180 / TILE_DEG)

#: Tiles by which the surroundings are larger than the flight: about 10 km.
_BEYOND: Final = 2

#: The most such tiles to the east and west: near the poles tiles are narrow.
_MOST_BEYOND: Final = 12

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


def ring(middle: Tile, distance: int) -> Iterator[Tile]:
    """The tiles at this many steps from a tile: itself at 0, then the 8 around it, then 16."""
    steps = range(-distance, distance + 1)
    for north in steps:
        at_edge = abs(north) == distance
        for east in steps if at_edge else (-distance, distance):
            yield Tile((middle.column + east) % _COLUMNS, middle.row + north)


def nearest_side_deg(here: Position, distance: int, *, narrowing: float) -> float:
    """The radius that the rings up to this one cover, in degrees of latitude."""
    east = (here.longitude_deg + 180.0) % TILE_DEG
    north = (here.latitude_deg + 90.0) % TILE_DEG
    beside = min(east, TILE_DEG - east) * narrowing
    above = min(north, TILE_DEG - north)
    return min(beside + distance * TILE_DEG * narrowing, above + distance * TILE_DEG)


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
        narrowing = max(math.cos(math.radians(furthest_deg)), _BEYOND / _MOST_BEYOND)
        beyond = math.ceil(_BEYOND / narrowing)
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
