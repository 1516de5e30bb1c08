"""What the zones of a network close: geometry only, the same for every problem on the network."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

from skyway.ids import StationId
from skyway.network.network import Network, Zone
from skyway.network.zones import contains, crosses

#: A segment by its ends; a network has at most one in each direction.
SegmentEnds = tuple[StationId, StationId]


@dataclass(frozen=True, slots=True)
class ZoneReach:
    """The stations that lie in a zone, and the segments that meet it."""

    zone: Zone
    stations: tuple[StationId, ...]
    segments: tuple[SegmentEnds, ...]


@dataclass(frozen=True, slots=True)
class Airspace:
    """The reach of every zone. Who composes often on one network makes this once."""

    reaches: tuple[ZoneReach, ...]

    @classmethod
    def of(cls, network: Network) -> Self:
        """The airspace above this network."""
        return cls(tuple(_reach(network, zone) for zone in network.zones))


def _reach(network: Network, zone: Zone) -> ZoneReach:
    stations: Mapping[StationId, bool] = {
        station_id: contains(zone, station.position)
        for station_id, station in network.stations.items()
    }
    # Opposite segments follow the same line.
    met: dict[SegmentEnds, bool] = {}
    for segment in network.segments:
        ends = (segment.from_id, segment.to_id)
        opposite = met.get((segment.to_id, segment.from_id))
        met[ends] = (
            crosses(zone, *(network.stations[end].position for end in ends))
            if opposite is None
            else opposite
        )
    return ZoneReach(
        zone,
        stations=tuple(station_id for station_id, is_inside in stations.items() if is_inside),
        segments=tuple(ends for ends, is_met in met.items() if is_met),
    )
