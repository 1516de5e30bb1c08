"""Do these stations exist, where are they, and does a path lead to each of them."""

from collections.abc import Collection, Iterable

from skyway.contracts.station_check import StationCheck, StationCheckQuery
from skyway.ids import StationId
from skyway.network.network import Network
from skyway.runtime.sql.database import Database
from skyway_composition.networks.prepared import PreparedNetworks
from skyway_composition.networks.stations.store import stations_named


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
