"""One GeoJSON feature read as a station, the segments of a line, or a zone."""

from collections.abc import Mapping
from typing import Any, NamedTuple

from skyway.errors import InvalidNetwork
from skyway.geo import Position, distance_m
from skyway.ids import StationId, ZoneId
from skyway.network import fields
from skyway.network.network import DEFAULT_PADS, MAX_PADS, Segment, Station, Zone
from skyway.network.opening_hours import HOURS, read_opening_hours
from skyway.network.pad_connectors import PAD_CONNECTORS, read_pad_connectors
from skyway.network.pad_power import has_power, read_pad_power

#: Longest segment that a document may hold, metres: half the Earth's circumference, rounded up.
MAX_SEGMENT_LENGTH_M = 20_100_000.0

#: How far the end of a segment's line may lie from its station, metres: room for rounded
#: coordinates, and close enough to notice a line drawn between other stations. Our own choice.
LINE_END_TOLERANCE_M = 100.0

STATION_PROPERTIES = ("kind", "station_id", "name", "pads", "parking")
SEGMENT_PROPERTIES = ("kind", "from", "to", "length_m", "one_way")
ZONE_PROPERTIES = ("kind", "zone_id", "active_from", "active_until")

#: The geometry of each kind of feature.
SHAPES = {"station": "Point", "segment": "LineString", "zone": "Polygon"}
_RING_LENGTH_MIN = 4


class Feature(NamedTuple):
    """A feature whose kind and shape agree; `properties` and `coordinates` are not yet read."""

    path: str
    kind: str
    properties: Mapping[str, Any]
    coordinates: Any  # any JSON value

    def property_path(self, name: str) -> str:
        """The path of one of its properties."""
        return f"{self.path}.properties.{name}"

    def property_identifier(self, name: str) -> str:
        """The identifier in this property, which must be there."""
        if name not in self.properties:
            raise InvalidNetwork(self.property_path(name), "is missing")
        return fields.identifier(self.properties[name], self.property_path(name))

    def unknown_properties(self, known: tuple[str, ...]) -> dict[str, Any]:
        """The properties that Skyway does not read."""
        return {name: value for name, value in self.properties.items() if name not in known}


def read_feature(value: Any, path: str) -> Feature:
    """The feature, after checking that its geometry has the shape of its kind."""
    feature = fields.mapping(value, path)
    fields.constant(feature.get("type"), f"{path}.type", expected="Feature")
    properties = fields.mapping(feature.get("properties"), f"{path}.properties")
    kind = properties.get("kind")
    if not isinstance(kind, str) or kind not in SHAPES:
        detail = f"{fields.shown(kind)} is none of {', '.join(SHAPES)}"
        raise InvalidNetwork(f"{path}.properties.kind", detail)
    geometry = fields.mapping(feature.get("geometry"), f"{path}.geometry")
    fields.constant(geometry.get("type"), f"{path}.geometry.type", expected=SHAPES[kind])
    return Feature(path, kind, properties, geometry.get("coordinates"))


def read_station(feature: Feature) -> Station:
    """The station of a Point feature; without `pads` it has 4, as in the paper."""
    pads = fields.whole_number(
        feature.properties.get("pads", DEFAULT_PADS),
        feature.property_path("pads"),
        low=0,
        high=MAX_PADS,
    )
    parking = feature.properties.get("parking", False)
    if HOURS in feature.properties:
        # The network keeps them among the properties, and reads them again.
        read_opening_hours(feature.properties[HOURS], feature.property_path(HOURS))
    if has_power(feature.properties):
        read_pad_power(feature.properties, f"{feature.path}.properties", pads=pads)
    if PAD_CONNECTORS in feature.properties:
        read_pad_connectors(feature.properties, f"{feature.path}.properties", pads=pads)
    return Station(
        station_id=StationId(feature.property_identifier("station_id")),
        position=fields.position(feature.coordinates, f"{feature.path}.geometry.coordinates"),
        pads=pads,
        name=fields.text_or_none(feature.properties.get("name"), feature.property_path("name")),
        properties=feature.unknown_properties(STATION_PROPERTIES),
        is_parking=fields.parking(parking, feature.property_path("parking"), pads=pads),
    )


def read_segments(feature: Feature, stations: Mapping[StationId, Station]) -> tuple[Segment, ...]:
    """The segment of a LineString feature, and its opposite unless it is `one_way`."""
    path = f"{feature.path}.geometry.coordinates"
    line = fields.array(feature.coordinates, path)
    if len(line) != 2:
        raise InvalidNetwork(path, f"{len(line)} positions instead of 2")
    start = _station_at(feature, "from", line[0], path=f"{path}.0", stations=stations)
    end = _station_at(feature, "to", line[1], path=f"{path}.1", stations=stations)
    if start is end:
        detail = f"the segment starts where it ends: {end.station_id!r}"
        raise InvalidNetwork(feature.property_path("to"), detail)
    length_m = feature.properties.get("length_m")
    if length_m is None:
        length_m = distance_m(start.position, end.position)
    length_m = fields.number(
        length_m, feature.property_path("length_m"), low=0.0, high=MAX_SEGMENT_LENGTH_M
    )
    unknown = feature.unknown_properties(SEGMENT_PROPERTIES)
    forth = Segment(start.station_id, end.station_id, length_m, unknown)
    one_way = feature.properties.get("one_way", False)
    if fields.truth(one_way, feature.property_path("one_way")):
        return (forth,)
    return (forth, Segment(end.station_id, start.station_id, length_m, unknown))


def read_zone(feature: Feature) -> Zone:
    """The zone of a Polygon feature."""
    active_from, active_until = (
        fields.moment_or_none(feature.properties.get(name), feature.property_path(name))
        for name in ("active_from", "active_until")
    )
    if active_from is not None and active_until is not None and active_until <= active_from:
        detail = f"{active_until} is not after active_from, {active_from}"
        raise InvalidNetwork(feature.property_path("active_until"), detail)
    return Zone(
        zone_id=ZoneId(feature.property_identifier("zone_id")),
        rings=_rings(feature.coordinates, f"{feature.path}.geometry.coordinates"),
        active_from=active_from,
        active_until=active_until,
        properties=feature.unknown_properties(ZONE_PROPERTIES),
    )


def _station_at(
    feature: Feature, name: str, drawn: Any, *, path: str, stations: Mapping[StationId, Station]
) -> Station:
    """The station that this property names; the line's end must be drawn where it stands."""
    station = stations.get(StationId(feature.property_identifier(name)))
    if station is None:
        detail = f"no station is called {feature.properties[name]!r}"
        raise InvalidNetwork(feature.property_path(name), detail)
    away_m = distance_m(fields.position(drawn, path), station.position)
    if away_m > LINE_END_TOLERANCE_M:
        detail = (
            f"the line ends {away_m:.0f} m from station {station.station_id!r}, "
            f"more than {LINE_END_TOLERANCE_M:g} m"
        )
        raise InvalidNetwork(path, detail)
    return station


def _rings(coordinates: Any, path: str) -> tuple[tuple[Position, ...], ...]:
    rings = []
    for number, value in enumerate(fields.array(coordinates, path)):
        below = f"{path}.{number}"
        ring = tuple(
            fields.position(corner, f"{below}.{index}")
            for index, corner in enumerate(fields.array(value, below))
        )
        if len(ring) < _RING_LENGTH_MIN:
            detail = f"{len(ring)} positions, fewer than {_RING_LENGTH_MIN}"
            raise InvalidNetwork(below, detail)
        if ring[0] != ring[-1]:
            raise InvalidNetwork(below, "the ring is not closed: its ends differ")
        rings.append(ring)
    if not rings:
        raise InvalidNetwork(path, "a zone without an outer ring")
    return tuple(rings)
