"""networkx: Dijkstra in plain Python over dictionaries."""

import networkx as nx
import numpy as np
import numpy.typing as npt
from skyway_lab.benchmarks.planner.peers.interface import PathTask


class NetworkxPaths:
    """Directed, weighted by length."""

    package = "networkx"

    def prepare(self, task: PathTask) -> "nx.DiGraph[int]":
        """A graph of numbered nodes."""
        graph: nx.DiGraph[int] = nx.DiGraph()
        graph.add_nodes_from(range(task.stations))
        columns = (task.from_row.tolist(), task.to_row.tolist(), task.length_m.tolist())
        graph.add_weighted_edges_from(zip(*columns, strict=True))
        return graph

    def lengths_m(self, graph: "nx.DiGraph[int]", source: int) -> npt.NDArray[np.float64]:
        """From the dictionary of lengths."""
        lengths = nx.single_source_dijkstra_path_length(graph, source)
        found = np.full(graph.number_of_nodes(), np.inf)
        found[list(lengths)] = list(lengths.values())
        return found
