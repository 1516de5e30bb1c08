import networkx
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from skyway.ids import StationId
from skyway.network.components import component_sizes, components, station_parts
from skyway.network.network import Network
from skyway.network.nx import from_networkx

LINES = st.lists(st.tuples(st.integers(0, 19), st.integers(0, 19)), max_size=25)


@given(lines=LINES)
def test_stations_of_one_component_have_its_smallest_row(lines: list[tuple[int, int]]) -> None:
    graph = networkx.empty_graph(20)
    graph.add_edges_from(lines)

    one, other = np.array(lines, np.int64).reshape(-1, 2).T
    root = components(one, other, stations=20).tolist()

    for component in networkx.connected_components(graph):
        assert {root[row] for row in component} == {min(component)}


def test_a_long_line_of_stations_is_one_component() -> None:
    order = np.random.default_rng(1).permutation(5_000)

    assert not components(order[:-1], order[1:], stations=5_000).any()


def make_network(lines: list[tuple[int, int]], *, graph: "networkx.Graph[int]") -> Network:
    graph.add_nodes_from((number, {"pos": (0.0, 0.0)}) for number in range(20))
    graph.add_edges_from(((a, b) for a, b in lines if a != b), length_m=1.0)
    return from_networkx(graph)


@given(lines=LINES)
def test_components_of_one_way_segments_are_the_strongly_connected_ones(
    lines: list[tuple[int, int]],
) -> None:
    graph: networkx.DiGraph[int] = networkx.DiGraph()

    sizes = component_sizes(make_network(lines, graph=graph))

    assert sorted(sizes) == sorted(map(len, networkx.strongly_connected_components(graph)))


@given(lines=LINES)
def test_components_of_two_way_segments_are_the_connected_ones(
    lines: list[tuple[int, int]],
) -> None:
    graph: networkx.Graph[int] = networkx.Graph()

    sizes = component_sizes(make_network(lines, graph=graph))

    assert sorted(sizes) == sorted(map(len, networkx.connected_components(graph)))


@given(lines=LINES)
def test_stations_of_one_part_reach_each_other(lines: list[tuple[int, int]]) -> None:
    graph: networkx.DiGraph[int] = networkx.DiGraph()
    network = make_network(lines, graph=graph)

    parts = station_parts(network).tolist()

    for component in networkx.strongly_connected_components(graph):
        assert len({parts[network.row_of[StationId(str(station))]] for station in component}) == 1
    assert len(set(parts)) == networkx.number_strongly_connected_components(graph)
