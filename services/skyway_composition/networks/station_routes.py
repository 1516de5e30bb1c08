"""Stations of networks over REST, and other services' questions about stations."""

from collections.abc import Collection, Iterable
from typing import Annotated, Final

from fastapi import Depends, Query
from pydantic import Field, field_validator

from skyway.contracts.station_check import (
    NetworkFacts,
    NetworkStations,
    StationCheck,
    StationCheckQuery,
)
from skyway.geo import Box, Position
from skyway.ids import NetworkId, StationId
from skyway.json_model import JsonModel
from skyway.network.components import station_parts
from skyway.network.network import Network
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import Conflict
from skyway.runtime.http.app import internal_body
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.paging import Page, PageQuery, page_of
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms
from skyway_composition.closures.store import closed_stations
from skyway_composition.networks.prepared import (
    NOTHING_PUBLISHED,
    PreparedNetwork,
    PreparedNetworks,
    current_row,
)
from skyway_composition.networks.station_store import (
    StationRow,
    stations_after,
    stations_named,
)
from skyway_composition.networks.store import has_networks

#: The most stations of a network that is sent whole: about a megabyte.
_MOST_SENT: Final = 20_000


class StationInfo(JsonModel):
    """A station of the current version."""

    station_id: Annotated[StationId, Field(description="Id of the station.")]
    name: Annotated[str | None, Field(description="Name of the station for people.")]
    pads: Annotated[int, Field(description="Number of pads, 0 or more.")]
    position: Annotated[
        Position,
        Field(description="[longitude, latitude] in degrees.", examples=[[16.37, 48.21]]),
    ]
    is_closed: Annotated[
        bool, Field(description="Whether a closure forbids drones to land here now.")
    ]


class StationQuery(PageQuery):
    """Which stations a list shows."""

    bbox: Annotated[
        str | None,
        Field(
            max_length=100,
            description="Only stations in this box: west,south,east,north in degrees.",
            examples=["16.3,48.1,16.5,48.3"],
        ),
    ] = None

    @field_validator("bbox")
    @classmethod
    def _is_a_box(cls, value: str | None) -> str | None:
        if value is not None:
            Box.parse(value)
        return value

    @property
    def box(self) -> Box | None:
        """The box that selects stations; None for all stations."""
        return None if self.bbox is None else Box.parse(self.bbox)


def station_routes(
    *, db: Database, gate: ServiceGate, networks: PreparedNetworks, clock: FleetClock
) -> ServiceRouter:
    """/v1/networks/{network_id}/stations."""
    router = ServiceRouter(tags=("networks",))

    @router.get("/v1/networks/{network_id}/stations")
    async def list_stations(
        network_id: NetworkId,
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[StationQuery, Query()],
    ) -> Page[StationInfo]:
        """List the stations of the current version by id, all or those in a `bbox`."""
        caller.must_be("customer", "provider", "operator", "service", "drone")
        await current_row(db, network_id)
        async with db.read() as connection:
            rows = await stations_after(
                connection,
                network_id,
                query.after_id() or "",
                box=query.box,
                limit=query.limit + 1,
            )
            closed = await closed_stations(connection, network_id, at_ms=moment_to_ms(clock.now()))
        return page_of(
            rows,
            query,
            item=lambda row: _station(row, closed),
            sort_key=lambda row: (row.station_id,),
        )

    return router


def station_check_routes(
    *, db: Database, gate: ServiceGate, networks: PreparedNetworks, clock: FleetClock
) -> ServiceRouter:
    """Other services' questions about stations, under /internal."""
    router = ServiceRouter(tags=("networks",))

    @router.post("/internal/station-checks")
    async def check_stations_exist(
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[StationCheckQuery, Depends(internal_body(StationCheckQuery))],
    ) -> StationCheck:
        """Check which of these stations exist, where they are, and which can be reached."""
        caller.must_be_service("gateway", "registry")
        return await _check_stations(db, networks, query, at_ms=moment_to_ms(clock.now()))

    @router.get("/internal/networks/{network_id}/stations")
    async def list_all_stations(
        caller: Annotated[Caller, Depends(gate)], network_id: NetworkId
    ) -> NetworkStations:
        """All stations of the current version, their positions and their connected parts."""
        caller.must_be_service("gateway", "registry")
        return _all_stations(await networks.current(network_id))

    return router


def _station(row: StationRow, closed: frozenset[StationId]) -> StationInfo:
    return StationInfo(
        station_id=row.station_id,
        name=row.name,
        pads=row.pads,
        position=row.position,
        is_closed=row.station_id in closed,
    )


async def _check_stations(
    db: Database, networks: PreparedNetworks, query: StationCheckQuery, *, at_ms: int
) -> StationCheck:
    """Which of these stations exist, where they are, and which of them cannot be reached.

    Raises
    ------
    Conflict
        No network is published at all, so there are no stations.
    """
    asked = list(dict.fromkeys(query.station_ids))
    start = query.reachable_from
    async with db.read() as connection:
        found = await stations_named(connection, asked if start is None else [*asked, start])
        known = {each: row for each, row in found.items() if networks.own.serves(row.network_id)}
        if not known.keys() >= set(asked) and not await has_networks(connection):
            raise Conflict("NO_NETWORK", NOTHING_PUBLISHED)
        closed = set[StationId]()
        for network_id in {row.network_id for row in known.values()}:
            closed |= await closed_stations(connection, network_id, at_ms=at_ms)
    unreachable: Iterable[StationId] = ()
    if start is not None:
        around = await networks.around(start) if start in known else None
        reached: Collection[StationId] = ()
        if around is not None:
            ends = {each for each in known if each in around.network.stations}
            reached = _reached(around.network, start, ends)
        unreachable = (each for each in asked if each in known and each not in reached)
    facts: dict[NetworkId, NetworkFacts] = {}
    isolated: list[StationId] = []
    for network_id in {each.network_id for each in known.values()} if query.as_homes else ():
        skyway = await networks.current(network_id)
        facts[network_id] = _facts(skyway)
        homes = [each for each in asked if each in skyway.network.stations]
        isolated += [each for each in homes if not skyway.network.segments_from(each)]
    return StationCheck(
        network_ids={each: known[each].network_id for each in asked if each in known},
        positions={each: known[each].position for each in asked if each in known},
        unknown=tuple(each for each in asked if each not in known),
        unreachable=tuple(unreachable),
        closed=tuple(each for each in asked if each in closed),
        isolated=tuple(isolated),
        networks=facts,
    )


def _facts(skyway: PreparedNetwork) -> NetworkFacts:
    network, connectors = skyway.network, skyway.network.pad_connectors
    fits_all = any(
        station.pads and station_id not in connectors.of_station
        for station_id, station in network.stations.items()
    )
    return NetworkFacts(
        currency=skyway.settings.currency,
        connectors=None if fits_all else tuple(sorted(connectors.named)),
        price_ceiling=skyway.settings.price_ceiling,
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


def _all_stations(skyway: PreparedNetwork) -> NetworkStations:
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
        names={columns.station_ids[row]: name for row, name in columns.names.items()},
        loading_s=skyway.settings.loading_s,
        dropoff_s=skyway.settings.dropoff_s,
        proof_s=skyway.settings.proof_s,
    )
