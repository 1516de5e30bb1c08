"""A network as the rows that the kernels read."""

from typing import TYPE_CHECKING

import numpy as np

from skyway.network.network import Network
from skyway.planner.kernels.memory import Skyway

if TYPE_CHECKING:
    from skyway.planner.hierarchy import Hierarchy


def rows_of(network: Network, hierarchy: "Hierarchy | None" = None) -> Skyway:
    """The network's segments from both their ends, its pads, and its hierarchy if there is one."""
    incoming, outgoing = network.incoming, network.outgoing
    no_ranks, no_lengths = np.empty(0, np.int64), np.empty(0)
    return Skyway(
        incoming.offsets,
        incoming.station,
        incoming.segment,
        incoming.length_m,
        outgoing.offsets,
        outgoing.station,
        outgoing.segment,
        outgoing.length_m,
        network.columns.pads,
        rank=no_ranks if hierarchy is None else hierarchy.rank,
        above_offsets=no_ranks if hierarchy is None else hierarchy.offsets,
        above=no_ranks if hierarchy is None else hierarchy.above,
        up_length=no_lengths if hierarchy is None else hierarchy.up_length,
        down_length=no_lengths if hierarchy is None else hierarchy.down_length,
    )
