"""Skyway networks as NetworkX graphs, in and out.

Nodes are stations; their attributes are `pos` (longitude and latitude in degrees, the name that
NetworkX's own drawing uses), `pads`, `parking` and `name`. Edges are segments; their attribute is
`length_m`. Other attributes are kept as properties. `graph.graph` may hold `zones` and `settings`.

Graphs of streets as OSMnx makes them are read too: `x` and `y` instead of `pos`, `length` in metres
instead of `length_m`, several edges between two nodes (the shortest counts, loops do not), and
`crs`, which must be EPSG:4326. The lines in `geometry` are not read: drones fly straight. NumPy's
numbers, truths and arrays count as Python's.
"""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from skyway.errors import InvalidNetwork
from skyway.geo import distance_m
from skyway.ids import StationId
from skyway.network import column_fields, fields
from skyway.network.column_fields import Doubtful, collector_paused
from skyway.network.columns import (
    Columns,
    Floats,
    Rows,
    first_repeated,
    parking_without_pads,
    segment_keys,
)
from skyway.network.geojson_features import MAX_SEGMENT_LENGTH_M
from skyway.network.network import Network
from skyway.network.parts import DEFAULT_PADS, MAX_PADS, Segment, Station

if TYPE_CHECKING:
    import networkx

_STATION_ATTRIBUTES = frozenset(("pos", "pads", "parking", "name"))
_SEGMENT_ATTRIBUTES = frozenset(("length_m",))


def from_networkx(graph: "networkx.Graph[Any]") -> Network:
    """The network of this graph; an edge of an undirected graph means both directions.

    The id of a station is its node's name or whole number, as text: node 1 is station "1". Without
    `pads` a station has 4 pads; without `length_m` a segment is as long as the great circle between
    its stations.

    Raises
    ------
    InvalidNetwork
        Names the node or edge and the attribute at fault: ``nodes.s1.pos``.
    """
    zones, settings = graph.graph.get("zones", ()), graph.graph.get("settings", {})
    if "crs" in graph.graph:
        fields.reference_system(graph.graph["crs"], "graph.crs")
    try:
        with collector_paused():
            columns = _columns(graph)
    except Doubtful:
        columns = _columns_one_by_one(_plain(graph))
    return Network.from_columns(columns, zones, dict(settings))


def _plain(graph: "networkx.Graph[Any]") -> "networkx.Graph[Any]":
    """The same graph in one form: Python's values, `pos` and `length_m`, one edge each way."""
    import networkx

    plain: networkx.Graph[Any] = networkx.DiGraph() if graph.is_directed() else networkx.Graph()
    for node, attributes in graph.nodes(data=True):
        plain.add_node(_value(node), **_renamed(attributes, pos=("x", "y")))
    for start, end, attributes in graph.edges(data=True):
        if start == end and graph.is_multigraph():
            continue
        edge = _renamed(attributes, length_m=("length",))
        before = plain.get_edge_data(_value(start), _value(end))
        if before is None or _is_shorter(edge, before):
            plain.add_edge(_value(start), _value(end), **edge)
    return plain


def _value(value: Any) -> Any:  # of any type
    """The value as Python's own, if it is one of NumPy's."""
    return value.tolist() if isinstance(value, (np.generic, np.ndarray)) else value


def _renamed(attributes: Mapping[str, Any], **forms: tuple[str, ...]) -> dict[str, Any]:
    """The attributes by Skyway's names: `forms` has the other names under which one may stand."""
    plain = {name: _value(value) for name, value in attributes.items() if name != "geometry"}
    for name, others in forms.items():
        if name not in plain and plain.keys() >= set(others):
            values = [plain.pop(each) for each in others]
            plain[name] = values if len(values) > 1 else values[0]
    return plain


def _is_shorter(edge: Mapping[str, Any], before: Mapping[str, Any]) -> bool:
    length_m, other_m = edge.get("length_m"), before.get("length_m")
    if not isinstance(length_m, (int, float)) or not isinstance(other_m, (int, float)):
        return False
    return length_m < other_m


def to_networkx(network: Network) -> "networkx.DiGraph[str]":
    """The directed graph of this network; `from_networkx` reads it back, segments reordered."""
    import networkx

    graph: networkx.DiGraph[str] = networkx.DiGraph()
    graph.graph.update(zones=network.zones, settings=dict(network.settings))
    columns = network.columns
    with collector_paused():
        graph.add_nodes_from(_nodes(columns))
        graph.add_edges_from(_edges(columns))
    return graph


def _nodes(columns: Columns) -> Iterator[tuple[str, dict[str, Any]]]:
    names, unread = columns.names, columns.station_properties
    longitudes, latitudes = columns.longitude_deg.tolist(), columns.latitude_deg.tolist()
    stations = zip(columns.station_ids, longitudes, latitudes, columns.pads.tolist(), strict=True)
    for row, (station_id, longitude_deg, latitude_deg, pads) in enumerate(stations):
        attributes = {**unread.get(row, {}), "pos": (longitude_deg, latitude_deg), "pads": pads}
        if row in names:
            attributes["name"] = names[row]
        if row in columns.parking:
            attributes["parking"] = True
        yield station_id, attributes


def _edges(columns: Columns) -> Iterator[tuple[str, str, dict[str, Any]]]:
    ids, unread = columns.station_ids, columns.segment_properties
    starts, ends = columns.from_row.tolist(), columns.to_row.tolist()
    segments = zip(starts, ends, columns.length_m.tolist(), strict=True)
    for row, (start, end, length_m) in enumerate(segments):
        yield ids[start], ids[end], {**unread.get(row, {}), "length_m": length_m}


def _columns(graph: "networkx.Graph[Any]") -> Columns:
    """The graph read by the column; raises `Doubtful` when a value is wrong or unusual."""
    nodes, attributes = list(graph.nodes), [each for _, each in graph.nodes(data=True)]
    if not set(map(type, nodes)) <= {str, int}:
        raise Doubtful
    ids = [StationId(str(node)) for node in nodes]
    column_fields.identifiers(ids)
    names = [each.get("name") for each in attributes]
    column_fields.texts_or_none(names)
    pads = column_fields.whole_numbers(
        [each.get("pads", DEFAULT_PADS) for each in attributes], low=0, high=MAX_PADS
    )
    parking = column_fields.rows_of_truth([each.get("parking", False) for each in attributes])
    if parking_without_pads(parking, pads) is not None:
        raise Doubtful
    longitude_deg, latitude_deg = column_fields.positions(column_fields.member(attributes, "pos"))
    row_of = {node: row for row, node in enumerate(nodes)}
    from_row, to_row, length_m, unread = _edge_columns(graph, row_of)
    return Columns(
        station_ids=tuple(ids),
        longitude_deg=longitude_deg,
        latitude_deg=latitude_deg,
        pads=pads.astype(np.int32),
        from_row=from_row,
        to_row=to_row,
        length_m=length_m,
        names={row: name for row, name in enumerate(names) if name is not None},
        station_properties=column_fields.unknown_members(attributes, _STATION_ATTRIBUTES),
        segment_properties=unread,
        parking=frozenset(parking),
    )


def _edge_columns(
    graph: "networkx.Graph[Any]", row_of: Mapping[Any, int]
) -> tuple[Rows, Rows, Floats, dict[int, dict[str, Any]]]:
    """Ends, lengths and unread attributes of the directed segments."""
    edges = list(graph.edges(data=True))
    start = np.array([row_of[one] for one, _, _ in edges], np.int32)
    end = np.array([row_of[other] for _, other, _ in edges], np.int32)
    length_m = column_fields.numbers(
        column_fields.member((each for _, _, each in edges), "length_m"),
        low=0.0,
        high=MAX_SEGMENT_LENGTH_M,
    )
    unread = column_fields.unknown_members([each for _, _, each in edges], _SEGMENT_ATTRIBUTES)
    if not graph.is_directed():
        start, end = _alternating(start, end), _alternating(end, start)
        length_m = np.repeat(length_m, 2)
        unread = {2 * row + way: each for row, each in unread.items() for way in (0, 1)}
    keys = segment_keys(start, end, stations=len(row_of))
    if (start == end).any() or first_repeated(keys) is not None:
        raise Doubtful
    return start, end, length_m, unread


def _alternating(forth: Rows, back: Rows) -> Rows:
    return np.column_stack((forth, back)).ravel()


def _columns_one_by_one(graph: "networkx.Graph[Any]") -> Columns:
    """The same as `_columns`, or an error that names the attribute at fault."""
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
    return Columns.of(stations, segments.values())


def _station(node: object, attributes: dict[str, Any]) -> Station:
    path = f"nodes.{node}"
    if not isinstance(node, (str, int)) or isinstance(node, bool):
        raise InvalidNetwork(path, "the id of a station is a string or a whole number")
    if "pos" not in attributes:
        raise InvalidNetwork(f"{path}.pos", "is missing: longitude and latitude in degrees")
    pads = fields.whole_number(
        attributes.get("pads", DEFAULT_PADS), f"{path}.pads", low=0, high=MAX_PADS
    )
    return Station(
        station_id=StationId(fields.identifier(str(node), path)),
        position=fields.position(attributes["pos"], f"{path}.pos"),
        pads=pads,
        name=fields.text_or_none(attributes.get("name"), f"{path}.name"),
        properties={k: v for k, v in attributes.items() if k not in _STATION_ATTRIBUTES},
        is_parking=fields.parking(attributes.get("parking", False), f"{path}.parking", pads=pads),
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
