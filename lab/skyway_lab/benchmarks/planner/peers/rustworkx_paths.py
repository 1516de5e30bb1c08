"""rustworkx: Dijkstra in Rust, which asks Python for each length."""

import numpy as np
import numpy.typing as npt
import rustworkx as rx
from skyway_lab.benchmarks.planner.peers.interface import PathTask


class RustworkxPaths:
    """Directed, the edge's payload is its length."""

    package = "rustworkx"

    def prepare(self, task: PathTask) -> "rx.PyDiGraph[None, float]":
        """A graph whose nodes are numbered in order."""
        graph: rx.PyDiGraph[None, float] = rx.PyDiGraph(multigraph=False)
        graph.add_nodes_from([None] * task.stations)
        columns = (task.from_row.tolist(), task.to_row.tolist(), task.length_m.tolist())
        graph.add_edges_from(list(zip(*columns, strict=True)))
        return graph

    def lengths_m(self, graph: "rx.PyDiGraph[None, float]", source: int) -> npt.NDArray[np.float64]:
        """From the mapping of lengths, which leaves out the source."""
        lengths = rx.dijkstra_shortest_path_lengths(graph, source, float)
        found = np.full(graph.num_nodes(), np.inf)
        found[list(lengths.keys())] = list(lengths.values())
        found[source] = 0.0
        return found
