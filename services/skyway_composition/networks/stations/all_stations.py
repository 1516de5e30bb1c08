"""A network's stations told at once, to those who would otherwise ask for a few at a time."""

from typing import Final

from skyway.contracts.station_check import NetworkStations
from skyway.geo import Position
from skyway.network.components import station_parts
from skyway_composition.networks.prepared import PreparedNetwork

#: The most stations that are told at once: about a megabyte.
_MOST_TOLD: Final = 20_000


def all_stations(skyway: PreparedNetwork) -> NetworkStations:
    """All stations of this version; none of a network that is too large."""
    columns = skyway.network.columns
    if len(columns.station_ids) > _MOST_TOLD:
        return NetworkStations(network_id=skyway.network_id, version=skyway.version)
    places = zip(columns.longitude_deg.tolist(), columns.latitude_deg.tolist(), strict=True)
    return NetworkStations(
        network_id=skyway.network_id,
        version=skyway.version,
        station_ids=columns.station_ids,
        positions=tuple(Position(*place) for place in places),
        parts=tuple(station_parts(skyway.network).tolist()),
    )
