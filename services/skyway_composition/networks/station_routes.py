"""Stations of networks over REST, and other services' questions about stations."""

from typing import Annotated

from fastapi import Depends, Query
from pydantic import Field, field_validator

from skyway.contracts.station_check import NetworkStations, StationCheck, StationCheckQuery
from skyway.geo import Position
from skyway.ids import NetworkId, StationId
from skyway.json_model import JsonModel
from skyway.runtime.clock import FleetClock
from skyway.runtime.http.app import internal_body
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.paging import Page, PageQuery, page_of
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms
from skyway_composition.closures.store import closed_stations
from skyway_composition.networks.prepared import PreparedNetworks, current_row
from skyway_composition.networks.station_check import all_stations, check_stations
from skyway_composition.networks.station_store import Box, StationRow, stations_after


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
        after = query.after(str)
        async with db.read() as connection:
            rows = await stations_after(
                connection,
                network_id,
                str(after[0]) if after else "",
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
    *, db: Database, gate: ServiceGate, networks: PreparedNetworks
) -> ServiceRouter:
    """Other services' questions about stations, under /internal."""
    router = ServiceRouter(tags=("networks",))

    @router.post("/internal/station-checks")
    async def check_stations_exist(
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[StationCheckQuery, Depends(internal_body(StationCheckQuery))],
    ) -> StationCheck:
        """Check which of these stations exist, where they are, and which can be reached."""
        caller.must_be("service")
        return await check_stations(db, networks, query)

    @router.get("/internal/networks/{network_id}/stations")
    async def list_all_stations(
        caller: Annotated[Caller, Depends(gate)], network_id: NetworkId
    ) -> NetworkStations:
        """All stations of the current version, their positions and their connected parts."""
        caller.must_be("service")
        return all_stations(await networks.current(network_id))

    return router


def _station(row: StationRow, closed: frozenset[StationId]) -> StationInfo:
    return StationInfo(
        station_id=row.station_id,
        name=row.name,
        pads=row.pads,
        position=row.position,
        is_closed=row.station_id in closed,
    )
