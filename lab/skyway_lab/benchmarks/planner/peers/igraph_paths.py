"""igraph: Dijkstra in C."""

import igraph
import numpy as np
import numpy.typing as npt
from skyway_lab.benchmarks.planner.peers.interface import PathTask


class IgraphPaths:
    """Directed, the lengths as an attribute of the edges."""

    package = "igraph"

    def prepare(self, task: PathTask) -> igraph.Graph:
        """A graph of numbered vertices."""
        return igraph.Graph(
            n=task.stations,
            edges=np.column_stack([task.from_row, task.to_row]),
            directed=True,
            edge_attrs={"length_m": task.length_m.tolist()},
        )

    def lengths_m(self, graph: igraph.Graph, source: int) -> npt.NDArray[np.float64]:
        """One row of the matrix of distances."""
        return np.array(graph.distances(source, weights="length_m")[0])
