"""Skyway networks as GeoJSON, in and out, in the form of docs/reference/planner-problem.md.

A station is a Point, a segment a LineString of two positions, a zone a Polygon; `properties.kind`
says which. Unknown members of `properties` are kept and written back; other unknown members are
not.
"""

from collections.abc import Iterable, Mapping
from typing import Any

from skyway.errors import InvalidNetwork
from skyway.ids import StationId, ZoneId
from skyway.network import fields
from skyway.network.column_fields import Doubtful, collector_paused
from skyway.network.columns import Columns
from skyway.network.feature_columns import read_by_column
from skyway.network.feature_writing import segment_features, station_features, zone_feature
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
