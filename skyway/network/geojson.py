"""Skyway networks as GeoJSON, in and out, in the form of docs/reference/planner-problem.md.

A station is a Point, a segment a LineString of two positions, a zone a Polygon; `properties.kind`
says which. Unknown members of `properties` are kept and written back; other unknown members are
not.
"""

from collections.abc import Iterable, Iterator, Mapping
from datetime import UTC, datetime
from typing import Any

import numpy as np
import numpy.typing as npt

from skyway.errors import InvalidNetwork
from skyway.ids import StationId, ZoneId
from skyway.network import fields
from skyway.network.column_fields import Doubtful, collector_paused
from skyway.network.columns import Columns, segment_keys
from skyway.network.feature_columns import read_by_column
from skyway.network.geojson_features import (
    SHAPES,
    Feature,
    read_feature,
    read_segments,
    read_station,
    read_zone,
)
from skyway.network.network import Network
from skyway.network.parts import Segment, Station, Zone


def read_network(document: Mapping[str, Any]) -> Network:
    """The network that a GeoJSON FeatureCollection describes.

    Features may stand in any order. A segment without `length_m` is as long as the great circle
    between its stations; unless it is `one_way` it stands for both directions.

    Parameters
    ----------
    document
        As `json.loads` gives it: any JSON value, checked here.

    Raises
    ------
    InvalidNetwork
        Names the field at fault by its path, ``features.3.properties.pads``, and the limit.
    """
    document = fields.mapping(document, "network")
    fields.constant(document.get("type"), "type", expected="FeatureCollection")
    features = fields.array(document.get("features"), "features")
    try:
        with collector_paused():
            columns, zone_features = read_by_column(features)
    except Doubtful:
        columns, zone_features = _read_one_by_one(features)
    return assembled(columns, zone_features, document)


def assembled(
    columns: Columns, zone_features: Iterable[Feature], members: Mapping[str, Any]
) -> Network:
    """The network of these columns and zones, with the settings among the document's members."""
    if members.get("crs") is not None:
        fields.reference_system(members["crs"], "crs")
    zones: dict[ZoneId, Zone] = {}
    for feature in zone_features:
        zone = read_zone(feature)
        if zone.zone_id in zones:
            detail = f"a second zone called {zone.zone_id!r}"
            raise InvalidNetwork(feature.property_path("zone_id"), detail)
        zones[zone.zone_id] = zone
    settings = dict(fields.mapping(members.get("settings", {}), "settings"))
    return Network.from_columns(columns, zones.values(), settings)


def write_network(network: Network) -> dict[str, Any]:
    """The GeoJSON FeatureCollection of this network: stations, then segments, then zones.

    Two opposite segments of equal length and equal properties become one LineString.
    """
    columns = network.columns
    with collector_paused():
        features = [*station_features(columns), *segment_features(columns)]
    features.extend(map(zone_feature, network.zones))
    document: dict[str, Any] = {"type": "FeatureCollection", "features": features}
    if network.settings:
        document["settings"] = dict(network.settings)
    return document


def _read_one_by_one(features: Iterable[Any]) -> tuple[Columns, list[Feature]]:
    """The same as `read_by_column`, or an error that names the field at fault."""
    by_kind: dict[str, list[Feature]] = {kind: [] for kind in SHAPES}
    for number, value in enumerate(features):
        feature = read_feature(value, f"features.{number}")
        by_kind[feature.kind].append(feature)
    stations: dict[StationId, Station] = {}
    for feature in by_kind["station"]:
        station = read_station(feature)
        if station.station_id in stations:
            detail = f"a second station called {station.station_id!r}"
            raise InvalidNetwork(feature.property_path("station_id"), detail)
        stations[station.station_id] = station
    segments: dict[tuple[StationId, StationId], Segment] = {}
    for feature in by_kind["segment"]:
        for segment in read_segments(feature, stations):
            ends = (segment.from_id, segment.to_id)
            if ends in segments:
                detail = f"a second segment from {segment.from_id!r} to {segment.to_id!r}"
                raise InvalidNetwork(feature.property_path("to"), detail)
            segments[ends] = segment
    return Columns.of(stations, segments.values()), by_kind["zone"]


def station_features(columns: Columns) -> Iterator[dict[str, Any]]:
    """The Points of the stations."""
    names, unread = columns.names, columns.station_properties
    longitudes, latitudes = columns.longitude_deg.tolist(), columns.latitude_deg.tolist()
    stations = zip(columns.station_ids, longitudes, latitudes, columns.pads.tolist(), strict=True)
    for row, (station_id, longitude_deg, latitude_deg, pads) in enumerate(stations):
        properties = dict(unread[row]) if row in unread else {}
        properties["kind"] = "station"
        properties["station_id"] = station_id
        if row in names:
            properties["name"] = names[row]
        properties["pads"] = pads
        if row in columns.parking:
            properties["parking"] = True
        yield _feature("Point", [longitude_deg, latitude_deg], properties)


def segment_features(columns: Columns) -> Iterator[dict[str, Any]]:
    """The LineStrings; two opposite segments of equal length and properties become one."""
    ids, unread = columns.station_ids, columns.segment_properties
    at = list(zip(columns.longitude_deg.tolist(), columns.latitude_deg.tolist(), strict=True))
    for row, start, end, length_m, is_one_way in lines(columns):
        properties = dict(unread[row]) if row in unread else {}
        properties["kind"] = "segment"
        properties["from"] = ids[start]
        properties["to"] = ids[end]
        properties["length_m"] = length_m
        properties["one_way"] = is_one_way
        yield _feature("LineString", [[*at[start]], [*at[end]]], properties)


def lines(columns: Columns) -> Iterator[tuple[int, int, int, float, bool]]:
    """For each LineString: its row, the rows of its start and end, its length, and `one_way`."""
    opposite = _opposite_rows(columns)
    rows = np.arange(len(opposite))
    # The first of two opposite segments stands for both.
    written = rows[(opposite < 0) | (rows < opposite)]
    return zip(
        written.tolist(),
        columns.from_row[written].tolist(),
        columns.to_row[written].tolist(),
        columns.length_m[written].tolist(),
        (opposite[written] < 0).tolist(),
        strict=True,
    )


def zone_feature(zone: Zone) -> dict[str, Any]:
    """The Polygon of a zone."""
    properties = {"kind": "zone", "zone_id": zone.zone_id}
    for name, moment in (("active_from", zone.active_from), ("active_until", zone.active_until)):
        if moment is not None:
            properties[name] = _rfc_3339(moment)
    rings = [[list(corner) for corner in ring] for ring in zone.rings]
    return _feature("Polygon", rings, {**zone.properties, **properties})


def _feature(shape: str, coordinates: Any, properties: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "type": "Feature",
        "geometry": {"type": shape, "coordinates": coordinates},
        "properties": properties,
    }


def _opposite_rows(columns: Columns) -> npt.NDArray[np.int64]:
    """The row of each segment's equal opposite, ``(m,)`` int64, -1 where there is none."""
    from_row, to_row, unread = columns.from_row, columns.to_row, columns.segment_properties
    stations = len(columns.station_ids)
    keys = segment_keys(from_row, to_row, stations=stations)
    if not len(keys):
        return keys
    order = np.argsort(keys)
    reversed_keys = segment_keys(to_row, from_row, stations=stations)
    place = np.minimum(np.searchsorted(keys, reversed_keys, sorter=order), len(keys) - 1)
    opposite = order[place]
    is_equal = (keys[opposite] == reversed_keys) & (columns.length_m[opposite] == columns.length_m)
    for row in unread:
        other = int(opposite[row])
        if is_equal[row] and unread.get(other) != unread[row]:
            is_equal[row] = is_equal[other] = False
    return np.where(is_equal, opposite, -1)


def _rfc_3339(moment: datetime) -> str:
    return moment.astimezone(UTC).isoformat().replace("+00:00", "Z")
