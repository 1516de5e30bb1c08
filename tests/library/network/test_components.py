import networkx
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from skyway.network.components import components

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
