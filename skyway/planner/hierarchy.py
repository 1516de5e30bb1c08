"""A network as the kernels read it, and a hierarchy that prepares it for long requests.

A hierarchy gives distances without growing a tree for each request. It is worth making for a
network on which many problems are solved. Without it the planner grows its trees as far as each
request reaches, which is as good for local requests.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np

from skyway.ids import ConnectorId
from skyway.network.great_circle import unrolled_deg
from skyway.network.network import Network
from skyway.planner.kernels.dissection import dissected
from skyway.planner.kernels.handles import handle_of
from skyway.planner.kernels.hierarchy import shortcut_lengths, shortcuts
from skyway.planner.kernels.memory import Floats, Longs
from skyway.planner.kernels.records import Skyway
from skyway.planner.weather import Weather


def rows_of(network: Network) -> Skyway:
    """The network's segments by both ends, and its pads; without a hierarchy or weather."""
    incoming, outgoing = network.incoming, network.outgoing
    no_ranks, no_lengths, no_factors = np.empty(0, np.int64), np.empty(0), np.empty((0, 0))
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
        network.is_two_way,
        rank=no_ranks,
        above_offsets=no_ranks,
        above=no_ranks,
        up_length=no_lengths,
        down_length=no_lengths,
        windy_segment=no_ranks,
        edges_s=no_lengths,
        time_factor=no_factors,
        energy_factor=no_factors,
        least_time_factor=no_lengths,
    )


def rows_in_weather(weather: Weather, *, until_s: float) -> Skyway:
    """The rows of the weather's network, for flights that begin between 0 and this moment."""
    return rows_of(weather.network)._replace(
        windy_segment=weather.segment,
        edges_s=weather.edges_s,
        time_factor=weather.time_factor,
        energy_factor=weather.energy_factor,
        least_time_factor=weather.least_time_factor(until_s=until_s),
    )


# Without slots: the arrays for the kernels are made once, for all problems.
@dataclass(frozen=True, eq=False)
class Hierarchy:
    """A contraction hierarchy of a network's segments by their length.

    `rank` is by station row, ``(n_stations,)``. The ranks above rank r, with which it shares a
    segment or shortcut, are ``above[offsets[r]:offsets[r + 1]]``, ascending; `up_length` and
    `down_length` are the metres to and from them.
    """

    network: Network
    rank: Longs
    offsets: Longs
    above: Longs
    up_length: Floats
    down_length: Floats
    _fitting: dict[int, Self] = field(default_factory=dict, init=False)

    @classmethod
    def of(cls, network: Network) -> Self:
        """The hierarchy of this network: a second for 10,000 stations, seconds for 100,000."""
        columns = network.columns
        skyway = handle_of(rows_of(network))
        stretch = np.cos(np.radians(columns.latitude_deg.mean())) if len(columns.pads) else 1.0
        rank = dissected(
            skyway, unrolled_deg(columns.longitude_deg) * stretch, columns.latitude_deg
        )
        offsets, above = shortcuts(skyway, rank)
        return cls(network, rank, offsets, above, *shortcut_lengths(skyway, rank, offsets, above))

    def fitting(self, connector: ConnectorId | None) -> Self:
        """The hierarchy of the network as a drone with this connector sees it."""
        network = self.network.fitting(connector)
        if network is self.network:
            return self
        # `self.network` keeps the networks that it returned, so each id stays that of one network.
        return self._fitting.setdefault(id(network), replace(self, network=network))

    @cached_property
    def skyway(self) -> Skyway:
        """The network with this hierarchy, as the kernels read it."""
        rows = rows_of(self.network)._replace(
            rank=self.rank,
            above_offsets=self.offsets,
            above=self.above,
            up_length=self.up_length,
            down_length=self.down_length,
        )
        return handle_of(rows)
