"""GeoJSON features read by the column: the fast way in, for documents without a fault.

It refuses without words whatever `geojson_features` would refuse, and then that reads the document
anew, one feature after another, to say what is wrong.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from skyway.ids import StationId
from skyway.network import column_fields
from skyway.network.column_fields import Doubtful
from skyway.network.columns import Columns, Floats, Rows, first_repeated, segment_keys
from skyway.network.geojson_features import (
    LINE_END_TOLERANCE_M,
    MAX_SEGMENT_LENGTH_M,
    SEGMENT_PROPERTIES,
    SHAPES,
    STATION_PROPERTIES,
    Feature,
)
from skyway.network.great_circle import distances_m
from skyway.network.parts import DEFAULT_PADS, MAX_PADS

#: Rounding can make a distance differ by less than this, metres; the slow way judges such ends.
_ROUNDING_M = 1e-3

_KNOWN_OF_STATION = frozenset(STATION_PROPERTIES)
_KNOWN_OF_SEGMENT = frozenset(SEGMENT_PROPERTIES)


@dataclass(frozen=True, slots=True, eq=False)
class _Features:
    """The features of one kind: where they stand, and what they hold unread."""

    numbers: list[int]
    properties: list[Any]  # objects of any JSON values
    coordinates: list[Any]  # any JSON values


@dataclass(frozen=True, slots=True, eq=False)
class _Stations:
    longitude_deg: Floats
    latitude_deg: Floats
    row_of: Mapping[StationId, int]


def read_by_column(features: Sequence[Any]) -> tuple[Columns, list[Feature]]:
    """The columns of stations and segments, and the zones' features, their rings unread.

    Raises
    ------
    Doubtful
        The features hold a fault, or something unusual.
    """
    by_kind = _by_kind(features)
    of_stations = by_kind["station"]
    ids = column_fields.member(of_stations.properties, "station_id")
    column_fields.identifiers(ids)
    names = [each.get("name") for each in of_stations.properties]
    column_fields.texts_or_none(names)
    pads = [each.get("pads", DEFAULT_PADS) for each in of_stations.properties]
    longitude_deg, latitude_deg = column_fields.positions(of_stations.coordinates)
    stations = _Stations(
        longitude_deg, latitude_deg, {station_id: row for row, station_id in enumerate(ids)}
    )
    from_row, to_row, length_m, properties = _segments(by_kind["segment"], stations)
    columns = Columns(
        station_ids=tuple(ids),
        longitude_deg=longitude_deg,
        latitude_deg=latitude_deg,
        pads=column_fields.whole_numbers(pads, low=0, high=MAX_PADS).astype(np.int32),
        from_row=from_row,
        to_row=to_row,
        length_m=length_m,
        names={row: name for row, name in enumerate(names) if name is not None},
        station_properties=column_fields.unknown_members(of_stations.properties, _KNOWN_OF_STATION),
        segment_properties=properties,
    )
    return columns, _zone_features(by_kind["zone"])


def _by_kind(features: Sequence[Any]) -> dict[str, _Features]:
    column_fields.constants(column_fields.member(features, "type"), ["Feature"] * len(features))
    properties = column_fields.member(features, "properties")
    kinds = column_fields.member(properties, "kind")
    if not set(map(type, kinds)) <= {str} or not set(kinds) <= set(SHAPES):
        raise Doubtful
    geometries = column_fields.member(features, "geometry")
    shapes = column_fields.member(geometries, "type")
    column_fields.constants(shapes, [SHAPES[kind] for kind in kinds])
    coordinates = column_fields.member(geometries, "coordinates")
    by_kind = {}
    for kind in SHAPES:
        numbers = [number for number, each in enumerate(kinds) if each == kind]
        by_kind[kind] = _Features(
            numbers, [properties[n] for n in numbers], [coordinates[n] for n in numbers]
        )
    return by_kind


def _segments(
    lines: _Features, stations: _Stations
) -> tuple[Rows, Rows, Floats, dict[int, dict[str, Any]]]:
    """The ends, lengths and unread properties of the directed segments that the lines mean."""
    start, end = (_end_rows(lines, name, stations) for name in ("from", "to"))
    longitude_deg, latitude_deg = column_fields.positions(
        column_fields.arrays(lines.coordinates, length=2)
    )
    for nth, rows in enumerate((start, end)):
        _refuse_ends_elsewhere(longitude_deg[nth::2], latitude_deg[nth::2], rows, stations)
    length_m = _lengths_m(lines, start, end, stations)
    one_way = [each.get("one_way", False) for each in lines.properties]
    column_fields.truths(one_way)

    is_both_ways = ~np.array(one_way, np.bool_)
    times = 1 + is_both_ways
    forth = np.cumsum(times) - times
    back = forth[is_both_ways] + 1
    from_row, to_row = np.repeat(start, times), np.repeat(end, times)
    from_row[back], to_row[back] = end[is_both_ways], start[is_both_ways]
    keys = segment_keys(from_row, to_row, stations=len(stations.row_of))
    if (from_row == to_row).any() or first_repeated(keys) is not None:
        raise Doubtful
    properties = {}
    for index, unknown in column_fields.unknown_members(
        lines.properties, _KNOWN_OF_SEGMENT
    ).items():
        for row in range(forth[index], forth[index] + times[index]):
            properties[row] = unknown
    return from_row, to_row, np.repeat(length_m, times), properties


def _end_rows(lines: _Features, name: str, stations: _Stations) -> Rows:
    try:
        rows = [stations.row_of[each] for each in column_fields.member(lines.properties, name)]
    except (KeyError, TypeError) as error:  # unknown, or nothing that a station could be called
        raise Doubtful(name) from error
    return np.array(rows, np.int32)


def _refuse_ends_elsewhere(
    longitude_deg: Floats, latitude_deg: Floats, rows: Rows, stations: _Stations
) -> None:
    """Every line must end where its station stands."""
    station_longitude_deg = stations.longitude_deg[rows]
    station_latitude_deg = stations.latitude_deg[rows]
    apart = (longitude_deg != station_longitude_deg) | (latitude_deg != station_latitude_deg)
    away_m = distances_m(
        (longitude_deg[apart], station_longitude_deg[apart]),
        (latitude_deg[apart], station_latitude_deg[apart]),
    )
    if (away_m > LINE_END_TOLERANCE_M - _ROUNDING_M).any():
        raise Doubtful


def _lengths_m(lines: _Features, start: Rows, end: Rows, stations: _Stations) -> Floats:
    """The lengths that the lines give, and the great circle's where they give none."""
    given = [each.get("length_m") for each in lines.properties]
    is_missing = np.array([each is None for each in given], np.bool_)
    length_m = np.empty(len(given))
    length_m[~is_missing] = column_fields.numbers(
        [each for each in given if each is not None], low=0.0, high=MAX_SEGMENT_LENGTH_M
    )
    ends = start[is_missing], end[is_missing]
    length_m[is_missing] = distances_m(
        (stations.longitude_deg[ends[0]], stations.longitude_deg[ends[1]]),
        (stations.latitude_deg[ends[0]], stations.latitude_deg[ends[1]]),
    )
    return length_m


def _zone_features(zones: _Features) -> list[Feature]:
    return [
        Feature(f"features.{number}", "zone", properties, coordinates)
        for number, properties, coordinates in zip(
            zones.numbers, zones.properties, zones.coordinates, strict=True
        )
    ]
