"""Skyway networks as GeoJSON, in and out, in the form of planner.md.

A station is a Point, a segment a LineString of two positions, a zone a Polygon; `properties.kind`
says which. What Skyway does not know in `properties` is kept and written back; foreign members
outside `properties` are not.
"""

from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from typing import Any

from skyway.errors import InvalidNetwork
from skyway.ids import StationId, ZoneId
from skyway.network import fields
from skyway.network.geojson_features import (
    Feature,
    read_feature,
    read_segments,
    read_station,
    read_zone,
)
from skyway.network.network import Network, Segment, Station, Zone


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
    by_kind: dict[str, list[Feature]] = {"station": [], "segment": [], "zone": []}
    for number, value in enumerate(fields.array(document.get("features"), "features")):
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
    zones: dict[ZoneId, Zone] = {}
    for feature in by_kind["zone"]:
        zone = read_zone(feature)
        if zone.zone_id in zones:
            detail = f"a second zone called {zone.zone_id!r}"
            raise InvalidNetwork(feature.property_path("zone_id"), detail)
        zones[zone.zone_id] = zone
    settings = dict(fields.mapping(document.get("settings", {}), "settings"))
    return Network(stations, tuple(segments.values()), tuple(zones.values()), settings)


def write_network(network: Network) -> dict[str, Any]:
    """The GeoJSON FeatureCollection of this network: stations, then segments, then zones.

    Two opposite segments of equal length and equal properties become one LineString.
    """
    features = [_station_feature(station) for station in network.stations.values()]
    features.extend(_segment_features(network))
    features.extend(_zone_feature(zone) for zone in network.zones)
    document: dict[str, Any] = {"type": "FeatureCollection", "features": features}
    if network.settings:
        document["settings"] = dict(network.settings)
    return document


def _feature(shape: str, coordinates: Any, properties: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "type": "Feature",
        "geometry": {"type": shape, "coordinates": coordinates},
        "properties": dict(properties),
    }


def _station_feature(station: Station) -> dict[str, Any]:
    properties: dict[str, Any] = {"kind": "station", "station_id": station.station_id}
    if station.name is not None:
        properties["name"] = station.name
    properties["pads"] = station.pads
    return _feature("Point", list(station.position), {**station.properties, **properties})


def _segment_features(network: Network) -> Iterable[dict[str, Any]]:
    by_ends = {(segment.from_id, segment.to_id): segment for segment in network.segments}
    collapsed = set()
    for (from_id, to_id), segment in by_ends.items():
        if (from_id, to_id) in collapsed:
            continue
        opposite = by_ends.get((to_id, from_id))
        is_both_ways = (
            opposite is not None
            and opposite.length_m == segment.length_m
            and opposite.properties == segment.properties
        )
        if is_both_ways:
            collapsed.add((to_id, from_id))
        properties = {
            **segment.properties,
            "kind": "segment",
            "from": from_id,
            "to": to_id,
            "length_m": segment.length_m,
            "one_way": not is_both_ways,
        }
        line = [list(network.stations[end].position) for end in (from_id, to_id)]
        yield _feature("LineString", line, properties)


def _zone_feature(zone: Zone) -> dict[str, Any]:
    properties = {"kind": "zone", "zone_id": zone.zone_id}
    for name, moment in (("active_from", zone.active_from), ("active_until", zone.active_until)):
        if moment is not None:
            properties[name] = _rfc_3339(moment)
    rings = [[list(corner) for corner in ring] for ring in zone.rings]
    return _feature("Polygon", rings, {**zone.properties, **properties})


def _rfc_3339(moment: datetime) -> str:
    return moment.astimezone(UTC).isoformat().replace("+00:00", "Z")
