"""scipy: Dijkstra in Cython over a sparse matrix."""

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from skyway_lab.benchmarks.planner.peers.interface import PathTask


class ScipyPaths:
    """Directed, the lengths as a matrix by rows."""

    package = "scipy"

    def prepare(self, task: PathTask) -> csr_array:
        """The sparse matrix of lengths."""
        places = (task.from_row, task.to_row)
        return csr_array((task.length_m, places), shape=(task.stations, task.stations))

    def lengths_m(self, graph: csr_array, source: int) -> npt.NDArray[np.float64]:
        """One row of distances."""
        lengths: npt.NDArray[np.float64] = dijkstra(graph, indices=source)
        return lengths
