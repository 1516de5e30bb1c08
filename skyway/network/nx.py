"""Skyway networks as NetworkX graphs, in and out.

Nodes are stations; their attributes are `pos` (longitude and latitude in degrees, the name that
NetworkX's own drawing uses), `pads` and `name`. Edges are segments; their attribute is `length_m`.
Other attributes are kept as properties. `graph.graph` may hold `zones` and `settings`.
"""

from typing import TYPE_CHECKING, Any

from skyway.errors import InvalidNetwork
from skyway.geo import distance_m
from skyway.ids import StationId
from skyway.network import fields
from skyway.network.geojson_features import MAX_SEGMENT_LENGTH_M
from skyway.network.network import DEFAULT_PADS, MAX_PADS, Network, Segment, Station

if TYPE_CHECKING:
    import networkx

_STATION_ATTRIBUTES = ("pos", "pads", "name")


def from_networkx(graph: "networkx.Graph[Any]") -> Network:
    """The network of this graph; an edge of an undirected graph means both directions.

    A node is called by its name or whole number. Without `pads` a station has 4; without
    `length_m` a segment is as long as the great circle between its stations.

    Raises
    ------
    InvalidNetwork
        Names the node or edge and the attribute at fault: ``nodes.s1.pos``.
    """
    stations: dict[StationId, Station] = {}
    for node, attributes in graph.nodes(data=True):
        station = _station(node, attributes)
        if station.station_id in stations:
            raise InvalidNetwork(f"nodes.{node}", f"a second station called {str(node)!r}")
        stations[station.station_id] = station
    segments: dict[tuple[StationId, StationId], Segment] = {}
    for start, end, attributes in graph.edges(data=True):
        forth = _segment(stations[StationId(str(start))], stations[StationId(str(end))], attributes)
        back = Segment(forth.to_id, forth.from_id, forth.length_m, forth.properties)
        for segment in (forth,) if graph.is_directed() else (forth, back):
            ends = (segment.from_id, segment.to_id)
            if ends in segments:
                raise InvalidNetwork(f"edges.{start}.{end}", "a second segment between these two")
            segments[ends] = segment
    zones, settings = graph.graph.get("zones", ()), graph.graph.get("settings", {})
    return Network(stations, tuple(segments.values()), tuple(zones), dict(settings))


def to_networkx(network: Network) -> "networkx.DiGraph[str]":
    """The directed graph of this network; `from_networkx` reads it back, segments reordered."""
    import networkx

    graph: networkx.DiGraph[str] = networkx.DiGraph()
    graph.graph.update(zones=network.zones, settings=dict(network.settings))
    for station in network.stations.values():
        own: dict[str, Any] = {"pos": tuple(station.position), "pads": station.pads}
        if station.name is not None:
            own["name"] = station.name
        graph.add_node(station.station_id, **{**station.properties, **own})
    for segment in network.segments:
        attributes = {**segment.properties, "length_m": segment.length_m}
        graph.add_edge(segment.from_id, segment.to_id, **attributes)
    return graph


def _station(node: object, attributes: dict[str, Any]) -> Station:
    path = f"nodes.{node}"
    if not isinstance(node, (str, int)):
        raise InvalidNetwork(path, "a station is called by a string or a whole number")
    if "pos" not in attributes:
        raise InvalidNetwork(f"{path}.pos", "is missing: longitude and latitude in degrees")
    return Station(
        station_id=StationId(fields.identifier(str(node), path)),
        position=fields.position(attributes["pos"], f"{path}.pos"),
        pads=fields.whole_number(
            attributes.get("pads", DEFAULT_PADS), f"{path}.pads", low=0, high=MAX_PADS
        ),
        name=fields.text_or_none(attributes.get("name"), f"{path}.name"),
        properties={k: v for k, v in attributes.items() if k not in _STATION_ATTRIBUTES},
    )


def _segment(start: Station, end: Station, attributes: dict[str, Any]) -> Segment:
    path = f"edges.{start.station_id}.{end.station_id}"
    if start is end:
        raise InvalidNetwork(path, "the segment starts where it ends")
    length_m = attributes.get("length_m")
    if length_m is None:
        length_m = distance_m(start.position, end.position)
    return Segment(
        from_id=start.station_id,
        to_id=end.station_id,
        length_m=fields.number(length_m, f"{path}.length_m", low=0.0, high=MAX_SEGMENT_LENGTH_M),
        properties={k: v for k, v in attributes.items() if k != "length_m"},
    )
