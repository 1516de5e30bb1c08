"""Shortest paths between stations, for the peers that ask for a matrix."""

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt
from skyway_lab.benchmarks.planner.our_tree import OurTree

from skyway.network.network import Network
from skyway.planner.hierarchy import rows_of
from skyway.planner.kernels.handles import handle_of


def lengths_m(network: Network, rows: Iterable[int]) -> npt.NDArray[np.float64]:
    """Metres of the shortest path from each of these rows to every station, ``(k, n)``."""
    tree, skyway = OurTree(network), handle_of(rows_of(network))
    return np.stack([tree.lengths_m(skyway, row) for row in rows])
