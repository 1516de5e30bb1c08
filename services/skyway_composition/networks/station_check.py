"""Do these stations exist, where are they, and does a path lead to each of them."""

from collections.abc import Collection, Iterable
from typing import Final

from skyway.contracts.station_check import NetworkStations, StationCheck, StationCheckQuery
from skyway.geo import Position
from skyway.ids import StationId
from skyway.network.components import station_parts
from skyway.network.network import Network
from skyway.runtime.sql.database import Database
from skyway_composition.networks.prepared import PreparedNetwork, PreparedNetworks
from skyway_composition.networks.station_store import stations_named


async def check_stations(
    db: Database, networks: PreparedNetworks, query: StationCheckQuery
) -> StationCheck:
    """What is known of the stations asked for."""
    asked = list(dict.fromkeys(query.station_ids))
    async with db.read() as connection:
        known = await stations_named(connection, asked)
    unreachable: Iterable[StationId] = ()
    if query.reachable_from is not None:
        around = await networks.around(query.reachable_from)
        reached: Collection[StationId] = ()
        if around is not None:
            wanted = {each for each in known if each in around.network.stations}
            reached = _reached(around.network, query.reachable_from, wanted)
        unreachable = (each for each in asked if each in known and each not in reached)
    return StationCheck(
        network_ids={each: known[each].network_id for each in asked if each in known},
        positions={each: known[each].position for each in asked if each in known},
        unknown=tuple(each for each in asked if each not in known),
        unreachable=tuple(unreachable),
    )


def _reached(network: Network, start: StationId, wanted: Collection[StationId]) -> set[StationId]:
    """Those wanted stations that a path leads to; the search ends once all are found."""
    seen, frontier = {start}, [start]
    missing = set(wanted) - seen
    while frontier and missing:
        for segment in network.segments_from(frontier.pop()):
            if segment.to_id not in seen:
                seen.add(segment.to_id)
                missing.discard(segment.to_id)
                frontier.append(segment.to_id)
    return set(wanted) - missing


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
