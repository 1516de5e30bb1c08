from typing import Any

import networkx
import numpy as np
import pytest

from skyway.errors import InvalidNetwork
from skyway.geo import Position, distance_m
from skyway.ids import StationId
from skyway.network.bundled import texas_corridor
from skyway.network.nx import from_networkx, to_networkx


def make_graph(graph: "networkx.Graph[Any]") -> "networkx.Graph[Any]":
    graph.add_node("a", pos=(0.0, 0.0), pads=2, roof="flat")
    graph.add_node("b", pos=(0.1, 0.0), name="Hall")
    return graph


def test_an_undirected_edge_means_both_directions() -> None:
    graph = make_graph(networkx.Graph())
    graph.add_edge("a", "b", length_m=12_000, wire=1)

    network = from_networkx(graph)

    assert [(s.from_id, s.to_id, s.length_m) for s in network.segments] == [
        ("a", "b", 12_000.0),
        ("b", "a", 12_000.0),
    ]
    assert network.segments[0].properties == {"wire": 1}


def test_a_directed_edge_means_one_direction_as_long_as_the_great_circle() -> None:
    graph = make_graph(networkx.DiGraph())
    graph.add_edge("b", "a")

    (segment,) = from_networkx(graph).segments

    assert (segment.from_id, segment.to_id) == ("b", "a")
    assert segment.length_m == distance_m(Position(0.1, 0.0), Position(0.0, 0.0))


def test_nodes_become_stations_with_their_attributes() -> None:
    stations = from_networkx(make_graph(networkx.Graph())).stations

    assert [(s.name, s.pads, s.properties) for s in stations.values()] == [
        (None, 2, {"roof": "flat"}),
        ("Hall", 4, {}),
    ]


def test_a_parking_station_is_read_and_written_as_an_attribute() -> None:
    graph = make_graph(networkx.Graph())
    graph.add_node("p", pos=(0.2, 0.0), parking=True)

    network = from_networkx(graph)

    assert [each.is_parking for each in network.stations.values()] == [False, False, True]
    assert from_networkx(to_networkx(network)) == network


def test_a_random_geometric_graph_of_networkx_is_a_network() -> None:
    graph = networkx.random_geometric_graph(20, 0.3, seed=1)

    network = from_networkx(graph)

    assert set(network.stations) == {str(number) for number in range(20)}
    assert len(network.segments) == 2 * graph.number_of_edges()


def test_a_network_written_as_a_graph_reads_as_the_same_network() -> None:
    network = texas_corridor()

    again = from_networkx(to_networkx(network))

    assert again.stations == network.stations
    assert again.zones == network.zones
    assert sorted(map(repr, again.segments)) == sorted(map(repr, network.segments))


@pytest.mark.parametrize("kind", [networkx.Graph, networkx.DiGraph])
def test_a_graph_is_the_same_network_with_and_without_lengths(kind: Any) -> None:
    with_lengths, without = make_graph(kind()), make_graph(kind())
    here, there = Position(0.0, 0.0), Position(0.1, 0.0)
    with_lengths.add_edge("a", "b", length_m=distance_m(here, there), wire=1)
    without.add_edge("a", "b", wire=1)

    assert from_networkx(with_lengths) == from_networkx(without)


@pytest.mark.parametrize(
    ("nodes", "edges", "message"),
    [
        ([("a", {})], [], "nodes.a.pos: is missing"),
        ([("a", {"pos": (0, 91)})], [], "nodes.a.pos.1: 91 is above 90"),
        ([("a", {"pos": (0, 0), "pads": -1})], [], "nodes.a.pads: -1 is below 0"),
        ([("a", {"pos": (0, 0), "parking": 1})], [], "nodes.a.parking: 1 is neither"),
        (
            [("a", {"pos": (0, 0), "pads": 0, "parking": True})],
            [],
            "nodes.a.parking: a parking station needs at least 1 pad",
        ),
        ([("a b", {"pos": (0, 0)})], [], "nodes.a b: 'a b' is not an identifier"),
        ([((0, 1), {"pos": (0, 0)})], [], "nodes.(0, 1): the id of a station is"),
        ([(1, {"pos": (0, 0)}), ("1", {"pos": (0, 0)})], [], "a second station called '1'"),
        ([(True, {"pos": (0, 0)})], [], "nodes.True: the id of a station is"),
        ([(np.True_, {"pos": (0, 0)})], [], "nodes.True: the id of a station is"),
        ([("a", {"x": 0.0, "y": float("nan")})], [], "nodes.a.pos.1: nan is not a finite number"),
        ([("a", {"x": np.float32("nan"), "y": 0.0})], [], "nodes.a.pos.0: nan is not a finite"),
        ([("a", {"pos": np.array([[0.0, 0.0]])})], [], "nodes.a.pos: 1 numbers instead"),
        ([("a", {"x": 0.0})], [], "nodes.a.pos: is missing"),
        ([("a", {"x": 181, "y": 0})], [], "nodes.a.pos.0: 181 is above 180"),
        (
            [("a", {"pos": (0, 0)}), ("b", {"pos": (0, 0)})],
            [("a", "b", {"length": [10, 20]})],
            "edges.a.b.length_m: an array is not a number",
        ),
        (
            [("a", {"pos": (0, 0)}), ("b", {"pos": (0, 0)})],
            [("a", "b", {"length_m": "far"})],
            "edges.a.b.length_m: 'far' is not a number",
        ),
    ],
)
def test_a_graph_that_is_no_network_is_refused(nodes: Any, edges: Any, message: str) -> None:
    graph: networkx.MultiGraph[Any] = networkx.MultiGraph()
    graph.add_nodes_from(nodes)
    graph.add_edges_from(edges)

    with pytest.raises(InvalidNetwork) as refusal:
        from_networkx(graph)

    assert message in str(refusal.value)


@pytest.mark.parametrize("crs", ["epsg:32614", "EPSG:3857", {"init": "x"}, 32614])
def test_a_graph_in_other_coordinates_is_refused_by_name(crs: Any) -> None:
    with pytest.raises(InvalidNetwork, match=r"graph\.crs"):
        from_networkx(networkx.MultiDiGraph(crs=crs))


def test_a_loop_is_refused_where_it_cannot_come_from_a_map_of_streets() -> None:
    graph: networkx.DiGraph[str] = networkx.DiGraph()
    graph.add_node("a", pos=(0, 0))
    graph.add_edge("a", "a")

    with pytest.raises(InvalidNetwork, match=r"edges\.a\.a: the segment starts where it ends"):
        from_networkx(graph)


@pytest.mark.parametrize(
    "pos", [(0.5, 1.0), [0.5, 1.0], np.array([0.5, 1.0]), np.array([0.5, 1.0], np.float32)]
)
def test_values_of_numpy_count_as_those_of_python(pos: Any) -> None:
    plain: networkx.Graph[Any] = networkx.Graph()
    plain.add_node("1", pos=(0.5, 1.0), pads=2, parking=True, roof=3)
    plain.add_node("2", pos=(0.6, 1.0))
    plain.add_edge("1", "2", length_m=12_000.0)
    other: networkx.Graph[Any] = networkx.Graph()
    other.add_node(np.int64(1), pos=pos, pads=np.int32(2), parking=np.True_, roof=np.uint8(3))
    other.add_node(2, pos=(np.float64(0.6), 1))
    other.add_edge(np.int64(1), 2, length_m=np.int64(12_000))

    assert from_networkx(other) == from_networkx(plain)


def test_a_graph_of_streets_is_read_as_it_is() -> None:
    """OSMnx gives x, y, length, several edges between two nodes, loops, lines and a crs."""
    streets: networkx.MultiDiGraph[Any] = networkx.MultiDiGraph(crs="epsg:4326")
    streets.add_node(42429, x=-97.9, y=29.9, street_count=3)
    streets.add_node(42430, x=-97.8, y=29.9, street_count=3)
    for length in (11_000.0, 9_700.5, 10_000.0):
        streets.add_edge(42429, 42430, osmid=[1, 2], length=length, geometry=object())
    streets.add_edge(42430, 42429, osmid=3, length=9_800.0, oneway=True)
    streets.add_edge(42430, 42430, osmid=4, length=120.0)

    network = from_networkx(streets)

    assert {each.station_id: each.position for each in network.stations.values()} == {
        "42429": (-97.9, 29.9),
        "42430": (-97.8, 29.9),
    }
    assert {(each.from_id, each.length_m) for each in network.segments} == {
        ("42429", 9_700.5),
        ("42430", 9_800.0),
    }
    assert network.stations[StationId("42429")].properties == {"street_count": 3}
    assert "geometry" not in network.segments[0].properties
