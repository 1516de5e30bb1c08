"""The exact search's own reverse tree, grown over the whole network."""

import numpy as np
import numpy.typing as npt

from benchmarks.planner.peers.interface import PathTask
from skyway.network.network import Network
from skyway.planner.exact_memory import enlarged, new_memory
from skyway.planner.exact_task import skyway_of
from skyway.planner.kernels.memory import PLACES, Closed, Skyway
from skyway.planner.kernels.places import place_of
from skyway.planner.kernels.trees import grow, plant

_EVERYWHERE = -1


class OurTree:
    """Grown as a search grows it: in memory that is made larger whenever it is full."""

    package = "skyway"

    def __init__(self, network: Network) -> None:
        self._network = network
        nothing_s, no_keys = np.empty(0), np.empty(0, np.int64)
        segments = network.columns.from_row.size
        self._closed = Closed(no_keys, np.zeros(1, np.int64), nothing_s, nothing_s, segments)

    def prepare(self, _task: PathTask) -> Skyway:
        """Build what the network keeps for all searches."""
        return skyway_of(self._network)

    def lengths_m(self, skyway: Skyway, source: int) -> npt.NDArray[np.float64]:
        """Metres from each station to this one, ``(n,)``: in a city the same as from it."""
        memory = new_memory(1)
        plant(memory, 0, place_of(memory, source))
        while not grow(skyway, self._closed, memory, 0, _EVERYWHERE, np.inf):
            memory = enlarged(memory)
        places = memory.count[PLACES]
        found = np.full(len(self._network.columns.station_ids), np.inf)
        found[memory.row[:places]] = memory.distance[:places, 0]
        return found
