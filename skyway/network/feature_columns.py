"""GeoJSON features read by the column: the fast reader, for documents without a fault.

It refuses, without a message, every document that `geojson_features` would refuse. Then
`geojson_features` reads the document again, feature by feature, and names the fault.
"""

from collections.abc import Iterable, Sequence
from typing import Any

from skyway.network import column_fields
from skyway.network.column_fields import Doubtful
from skyway.network.columns import Columns
from skyway.network.geojson_features import SHAPES, Feature
from skyway.network.line_columns import LineColumns
from skyway.network.station_columns import StationColumns

#: Features read together: few enough to stay in a processor's cache.
_BLOCK = 500


def read_by_column(features: Sequence[Any]) -> tuple[Columns, list[Feature]]:
    """The columns of stations and segments, and the zones' features, their rings unread.

    Raises
    ------
    Doubtful
        The features hold a fault, or something unusual.
    """
    return read_blocks(
        features[start : start + _BLOCK] for start in range(0, len(features), _BLOCK)
    )


def read_blocks(blocks: Iterable[Sequence[Any]]) -> tuple[Columns, list[Feature]]:
    """The same as `read_by_column`, for features that come block after block."""
    stations, lines = StationColumns(), LineColumns()
    zones: list[Feature] = []
    number = 0
    for block in blocks:
        kinds, properties, coordinates = _opened(block)
        of_kind = {kind: [i for i, each in enumerate(kinds) if each == kind] for kind in SHAPES}
        read = {
            kind: ([properties[i] for i in indices], [coordinates[i] for i in indices])
            for kind, indices in of_kind.items()
        }
        stations.read(*read["station"])
        lines.read(*read["segment"], row_of=stations.row_of)
        zones.extend(
            Feature(f"features.{number + i}", "zone", properties[i], coordinates[i])
            for i in of_kind["zone"]
        )
        number += len(block)
    placed = stations.placed()
    segments = lines.directed(placed)
    columns_read = Columns(
        station_ids=tuple(placed.row_of),
        longitude_deg=placed.longitude_deg,
        latitude_deg=placed.latitude_deg,
        pads=stations.pads(),
        from_row=segments.from_row,
        to_row=segments.to_row,
        length_m=segments.length_m,
        names=stations.names,
        station_properties=stations.unread,
        segment_properties=segments.unread,
        parking=frozenset(stations.parking),
    )
    return columns_read, zones


def _opened(features: Sequence[Any]) -> tuple[list[str], list[Any], list[Any]]:
    """The kind, the properties and the coordinates of each feature."""
    column_fields.constants(column_fields.member(features, "type"), ["Feature"] * len(features))
    properties = column_fields.member(features, "properties")
    kinds = column_fields.member(properties, "kind")
    if not set(map(type, kinds)) <= {str} or not set(kinds) <= set(SHAPES):
        raise Doubtful
    geometries = column_fields.member(features, "geometry")
    shapes = column_fields.member(geometries, "type")
    column_fields.constants(shapes, [SHAPES[kind] for kind in kinds])
    return kinds, properties, column_fields.member(geometries, "coordinates")
