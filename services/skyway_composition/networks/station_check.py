"""What other services ask about stations: do they exist, where, and does a path lead there."""

from collections.abc import Collection, Iterable
from typing import Final

from skyway.contracts.station_check import NetworkStations, StationCheck, StationCheckQuery
from skyway.geo import Position
from skyway.ids import StationId
from skyway.network.components import station_parts
from skyway.network.network import Network
from skyway.runtime.errors import Conflict
from skyway.runtime.sql.database import Database
from skyway_composition.networks.prepared import (
    NOTHING_PUBLISHED,
    PreparedNetwork,
    PreparedNetworks,
)
from skyway_composition.networks.station_store import stations_named
from skyway_composition.networks.store import has_networks

#: The most stations of a network that is sent whole: about a megabyte.
_MOST_SENT: Final = 20_000


async def check_stations(
    db: Database, networks: PreparedNetworks, query: StationCheckQuery
) -> StationCheck:
    """Which of these stations exist, where they are, and which of them cannot be reached.

    Raises
    ------
    Conflict
        No network is published at all, so there are no stations.
    """
    asked = list(dict.fromkeys(query.station_ids))
    async with db.read() as connection:
        known = await stations_named(connection, asked)
        if len(known) < len(asked) and not await has_networks(connection):
            raise Conflict("NO_NETWORK", NOTHING_PUBLISHED)
    unreachable: Iterable[StationId] = ()
    if query.reachable_from is not None:
        around = await networks.around(query.reachable_from)
        reached: Collection[StationId] = ()
        if around is not None:
            ends = {each for each in known if each in around.network.stations}
            reached = _reached(around.network, query.reachable_from, ends)
        unreachable = (each for each in asked if each in known and each not in reached)
    return StationCheck(
        network_ids={each: known[each].network_id for each in asked if each in known},
        positions={each: known[each].position for each in asked if each in known},
        unknown=tuple(each for each in asked if each not in known),
        unreachable=tuple(unreachable),
    )


def _reached(network: Network, start: StationId, ends: Collection[StationId]) -> set[StationId]:
    """The stations of `ends` that a path leads to; the search ends when all are found."""
    seen, frontier = {start}, [start]
    missing = set(ends) - seen
    while frontier and missing:
        for segment in network.segments_from(frontier.pop()):
            if segment.to_id not in seen:
                seen.add(segment.to_id)
                missing.discard(segment.to_id)
                frontier.append(segment.to_id)
    return set(ends) - missing


def all_stations(skyway: PreparedNetwork) -> NetworkStations:
    """All stations of this version, for services that cache them; none of a large network."""
    columns = skyway.network.columns
    if len(columns.station_ids) > _MOST_SENT:
        return NetworkStations(network_id=skyway.network_id, version=skyway.version)
    places = zip(columns.longitude_deg.tolist(), columns.latitude_deg.tolist(), strict=True)
    return NetworkStations(
        network_id=skyway.network_id,
        version=skyway.version,
        station_ids=columns.station_ids,
        positions=tuple(Position(*place) for place in places),
        parts=tuple(station_parts(skyway.network).tolist()),
        loading_s=skyway.settings.loading_s,
        dropoff_s=skyway.settings.dropoff_s,
    )
