"""Distances through a hierarchy and through trees are those of Dijkstra's algorithm."""

from random import Random

import networkx as nx
import numpy as np
import pytest

from skyway.geo import Position
from skyway.ids import StationId
from skyway.network.network import Network, Segment, Station
from skyway.planner.exact_memory import Room, enlarged, new_memory
from skyway.planner.hierarchy import Hierarchy, rows_of
from skyway.planner.kernels import trees
from skyway.planner.kernels.dissection import dissected
from skyway.planner.kernels.handles import handle_of
from skyway.planner.kernels.hierarchy import root_all
from skyway.planner.kernels.memory import FULL, Floats, Longs, Memory
from skyway.planner.kernels.records import Closed, Skyway

_OPEN = Closed(np.empty(0, np.int64), np.zeros(1, np.int64), np.empty(0), np.empty(0), 0, True)


def _network(stations: int, *, seed: int) -> Network:
    """Segments of random length, half of them one-way, on positions that may coincide."""
    random = Random(seed)
    names = [StationId(f"s{number}") for number in range(stations)]
    ends = {
        (start, end)
        for start in range(stations)
        for end in random.sample(range(stations), min(stations, 3))
        if start != end and abs(start - end) < 40
    }
    ends |= {(end, start) for start, end in sorted(ends) if random.random() < 0.5}
    return Network(
        {
            name: Station(name, Position(random.randrange(8) / 10, random.randrange(8) / 10))
            for name in names
        },
        [Segment(names[a], names[b], random.uniform(1e3, 9e3)) for a, b in sorted(ends)],
    )


def _graph(network: Network) -> "nx.DiGraph[int]":
    columns = network.columns
    graph: nx.DiGraph[int] = nx.DiGraph()
    graph.add_nodes_from(range(len(columns.pads)))
    graph.add_weighted_edges_from(
        zip(columns.from_row.tolist(), columns.to_row.tolist(), columns.length_m, strict=True)
    )
    return graph


def _expected_m(network: Network, roots: list[int]) -> list[list[float]]:
    graph = _graph(network).reverse()
    to_root = [nx.single_source_dijkstra_path_length(graph, root) for root in roots]
    return [[to.get(row, np.inf) for to in to_root] for row in range(len(graph))]


@pytest.mark.parametrize("stations", [1, 2, 5, 20, 100, 500])
def test_a_hierarchys_distances_are_dijkstras(stations: int) -> None:
    network = _network(stations, seed=stations)
    roots = sorted({0, stations // 2, stations - 1})
    hierarchy = Hierarchy.of(network)
    skyway, closed = hierarchy.skyway, handle_of(_OPEN)
    memory = new_memory(len(roots), stations)
    notes = handle_of(memory)
    root_all(skyway, notes, np.array(roots, np.int32))
    memory.radius[:] = np.inf

    rows = np.arange(stations, dtype=np.int32)
    found_m = [
        trees.distances(
            skyway, closed, notes, np.full(len(roots), row, np.int32), int(row), len(roots)
        )[-1]
        for row in rows
    ]

    assert np.array(found_m) == pytest.approx(np.array(_expected_m(network, roots)))


@pytest.mark.parametrize("stations", [5, 20, 100])
def test_a_tree_is_final_up_to_its_radius_and_never_too_far_beyond(stations: int) -> None:
    network = _network(stations, seed=stations + 1)
    skyway, closed = handle_of(rows_of(network)), handle_of(_OPEN)
    roots = [0, stations - 1]
    memory = new_memory(2, room=Room(places=2, arcs=2, windows=2, states=2, labels=2))
    rows = np.array(roots, np.int32)

    while not trees.plant_all(skyway, closed, handle_of(memory), rows, 0, stations // 2):
        memory = enlarged(memory)

    expected_m = _expected_m(network, roots)
    for place in range(int(memory.counts[0])):
        for tree in range(2):
            length_m = expected_m[memory.row[place]][tree]
            bound_m = min(memory.distance[tree, place], memory.radius[tree])
            assert bound_m <= length_m + 1e-6
            if memory.distance[tree, place] <= memory.radius[tree]:
                assert memory.distance[tree, place] == pytest.approx(length_m)


def _two_way_network(stations: int, *, seed: int) -> Network:
    """Random ways there and back between stations of near numbers, many of the same length.

    Some stations may have no way to others.
    """
    random = Random(seed)
    names = [StationId(f"s{number}") for number in range(stations)]
    ways = {
        (start, end)
        for start in range(stations)
        for end in random.sample(range(start, min(stations, start + 9)), 1)
        if start != end
    }
    lines = [(names[a], names[b], random.choice([1e3, 0.1, 7e3 / 3])) for a, b in sorted(ways)]
    return Network(
        {name: Station(name, Position(0.0, 0.0)) for name in names},
        [Segment(*ends, m) for a, b, m in lines for ends in ((a, b), (b, a))],
    )


def _closed_for_good(segments: Longs) -> Closed:
    always_s = np.full(len(segments), np.inf)
    offsets = np.arange(len(segments) + 1)
    return handle_of(Closed(segments, offsets, -always_s, always_s, 0, is_two_way=True))


@pytest.mark.parametrize("stations", [2, 10, 60, 300])
@pytest.mark.parametrize("seed", range(5))
def test_trees_that_meet_give_the_distances_of_trees_that_hold_all_roots(
    stations: int, seed: int
) -> None:
    network = _two_way_network(stations, seed=seed)
    lines = len(network.columns.length_m) // 2
    shut = np.array(Random(seed).sample(range(lines), lines // 9), np.int64)
    closed = _closed_for_good(np.sort(np.concatenate([2 * shut, 2 * shut + 1])))
    roots = np.array(Random(seed).sample(range(stations), min(stations, 5)), np.int32)
    count, source = len(roots) - 1, int(roots[-1])

    def found(skyway: Skyway) -> tuple[Memory, Floats]:
        room = Room(places=2, arcs=2, windows=2, states=2, labels=2)
        memory = new_memory(count, room=room)
        while True:
            notes = handle_of(memory)
            if trees.plant_all(skyway, closed, notes, roots[:-1], source, source):
                apart_m = trees.distances(skyway, closed, notes, roots[:-1], source, count)
                if not memory.counts[FULL]:
                    return memory, apart_m
            memory = enlarged(memory)

    rows = rows_of(network)
    meeting, apart_m = found(handle_of(rows))
    whole, expected_m = found(handle_of(rows._replace(is_two_way=False)))

    assert rows.is_two_way
    assert apart_m.tolist() == expected_m.tolist()
    assert meeting.reach.tolist() == whole.reach.tolist()
    assert (meeting.radius <= whole.radius).all()
    if not shut.size:
        by_networkx_m = np.array(_expected_m(network, roots[:-1].tolist()))
        assert expected_m == pytest.approx(by_networkx_m[[*roots[:-1], source]])


@pytest.mark.parametrize("stations", [1, 3, 50, 400])
def test_dissection_ranks_every_station_once(stations: int) -> None:
    network = _network(stations, seed=stations)
    columns = network.columns

    rank = dissected(handle_of(rows_of(network)), columns.longitude_deg, columns.latitude_deg)

    assert sorted(rank.tolist()) == list(range(stations))
