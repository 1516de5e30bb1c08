"""Stations that are known without asking: where they are, and of which networks.

There may be stations that are not known here. A network too large to be told at once, or to be kept
beside the others, has none that are known.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final

from skyway.contracts.station_check import NetworkStations
from skyway.geo import Position
from skyway.ids import NetworkId, StationId

#: The most stations that are kept, of all networks together: a hundred bytes each, or two.
_MOST_KEPT: Final = 200_000


@dataclass(frozen=True, slots=True)
class _Known:
    """The stations of one version: where each is, and to which part of the network it belongs."""

    version: int
    places: Mapping[StationId, tuple[Position, int]]


class KnownNetworks:
    """Networks by their stations, in one version each; no two networks have the same station.

    Who keeps what follows from them does so anew once `revision` is another.
    """

    def __init__(self) -> None:
        self._networks: dict[NetworkId, _Known] = {}
        self.revision = 0

    def start_of_ways(self, start: StationId, *, to: Iterable[StationId]) -> Position | None:
        """Where a station is from which ways are known to lead to all of these; else None."""
        for network in self._networks.values():
            if (place := network.places.get(start)) is not None:
                position, part = place
                ends = (network.places.get(each) for each in to)
                return position if all(end and end[1] == part for end in ends) else None
        return None

    def network_of(self, station_id: StationId) -> NetworkId | None:
        """The network that has this station; None when none is known to."""
        for network_id, network in self._networks.items():
            if station_id in network.places:
                return network_id
        return None

    def version_of(self, network_id: NetworkId) -> int | None:
        """Which version of a network is known."""
        known = self._networks.get(network_id)
        return None if known is None else known.version

    def keep(self, told: NetworkStations) -> None:
        """Know this version of a network: all of it, or no station when that would be too much."""
        self.drop(told.network_id)
        kept = sum(len(network.places) for network in self._networks.values())
        places: Mapping[StationId, tuple[Position, int]] = {}
        if kept + len(told.station_ids) <= _MOST_KEPT:
            each = zip(told.positions, told.parts, strict=True)
            places = dict(zip(told.station_ids, each, strict=True))
        self._networks[told.network_id] = _Known(told.version, places)
        self.revision += 1

    def drop(self, network_id: NetworkId) -> None:
        """Know nothing of a network."""
        self._networks.pop(network_id, None)
        self.revision += 1

    def forget(self) -> None:
        """Know nothing at all."""
        self._networks.clear()
        self.revision += 1
