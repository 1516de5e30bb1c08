"""A network as the rows that the kernels read."""

import numpy as np

from skyway.network.network import Network
from skyway.planner.kernels.records import Skyway


def rows_of(network: Network) -> Skyway:
    """The network's segments by both ends, and its pads; without a hierarchy."""
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
        rank=no_ranks,
        above_offsets=no_ranks,
        above=no_ranks,
        up_length=no_lengths,
        down_length=no_lengths,
    )
