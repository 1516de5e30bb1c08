"""The exact search's own reverse tree, grown over the whole network."""

import numpy as np
import numpy.typing as npt
from skyway_lab.benchmarks.planner.peers.interface import PathTask

from skyway.network.network import Network
from skyway.planner.exact_memory import enlarged, new_memory
from skyway.planner.hierarchy import rows_of
from skyway.planner.kernels.handles import handle_of
from skyway.planner.kernels.memory import PLACES
from skyway.planner.kernels.records import Closed, Skyway
from skyway.planner.kernels.trees import plant_all


class OurTree:
    """Grown as a search grows it: in memory that is made larger whenever it is full."""

    package = "skyway"

    def __init__(self, network: Network) -> None:
        self._network = network
        nothing_s, no_keys = np.empty(0), np.empty(0, np.int64)
        segments = network.columns.from_row.size
        self._closed = handle_of(
            Closed(no_keys, np.zeros(1, np.int64), nothing_s, nothing_s, segments, True)
        )

    def prepare(self, _task: PathTask) -> Skyway:
        """Build the arrays that all searches on the network share."""
        return handle_of(rows_of(self._network))

    def lengths_m(self, graph: Skyway, source: int) -> npt.NDArray[np.float64]:
        """Metres from each station to this one, ``(n,)``: in a city the same as from it."""
        stations = len(self._network.columns.station_ids)
        # A tree grows until it reaches the requested row. No station has this row, so the tree
        # grows over all stations.
        nowhere = stations
        memory = new_memory(1)
        root = np.array([source], np.int32)
        while not plant_all(graph, self._closed, handle_of(memory), root, nowhere, nowhere):
            memory = enlarged(memory)
        places = memory.counts[PLACES]
        found = np.full(stations + 1, np.inf)
        found[memory.row[:places]] = memory.distance[0, :places]
        return found[:stations]
