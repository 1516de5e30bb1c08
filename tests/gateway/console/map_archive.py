"""A base map in one PMTiles file, whose single tile shows one square of land."""

from pathlib import Path
from typing import Final

from pmtiles.tile import Compression, TileType, zxy_to_tileid
from pmtiles.writer import Writer

#: The name of the tile's layer.
LAND: Final = "land"

_EXTENT: Final = 4096
#: A square over the whole tile, in the commands of vector tiles: move, three lines, close.
_SQUARE: Final = (9, 0, 0, 26, 2 * _EXTENT, 0, 0, 2 * _EXTENT, 2 * _EXTENT - 1, 0, 15)
_POLYGON: Final = 3


def write_archive(path: Path) -> None:
    """Write the file. Its tile is that of the whole world, which maps enlarge."""
    bounds = {"min_lon_e7": -1_800_000_000, "max_lon_e7": 1_800_000_000}
    bounds |= {"min_lat_e7": -850_000_000, "max_lat_e7": 850_000_000}
    header = {
        **bounds,
        "tile_type": TileType.MVT,
        "tile_compression": Compression.NONE,
        "min_zoom": 0,
        "max_zoom": 0,
        "center_zoom": 0,
        "center_lon_e7": 0,
        "center_lat_e7": 0,
    }
    with path.open("wb") as output:
        writer = Writer(output)
        writer.write_tile(zxy_to_tileid(0, 0, 0), _tile())
        writer.finalize(header, {"vector_layers": [{"id": LAND, "fields": {}}]})


def _tile() -> bytes:
    feature = _number(3, _POLYGON) + _bytes(4, b"".join(map(_varint, _SQUARE)))
    name, version, extent = _bytes(1, LAND.encode()), _number(15, 2), _number(5, _EXTENT)
    return _bytes(3, version + name + _bytes(2, feature) + extent)


def _varint(value: int) -> bytes:
    out = bytearray()
    while value > 127:
        out.append(value & 127 | 128)
        value >>= 7
    return bytes([*out, value])


def _number(field: int, value: int) -> bytes:
    return _varint(field << 3) + _varint(value)


def _bytes(field: int, content: bytes) -> bytes:
    return _varint(field << 3 | 2) + _varint(len(content)) + content
