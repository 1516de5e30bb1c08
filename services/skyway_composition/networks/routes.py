"""Networks over REST: versions as GeoJSON, forecasts, and whether they accept deliveries now.

Operators publish networks, and all callers read them.
"""

import asyncio
from datetime import datetime
from typing import Annotated, Final

from fastapi import Depends, Header, Query, Request, Response
from pydantic import Field, ValidationError

from skyway.complaints import fault_of
from skyway.contracts.network_document import NetworkDocument
from skyway.contracts.weather import ForecastDocument, WeatherInForce
from skyway.errors import InvalidInput, InvalidNetwork
from skyway.ids import DroneModelId, NetworkId
from skyway.json_model import JsonModel, QueryModel
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import NotFound
from skyway.runtime.http.answers import GEOJSON, NOT_FOUND, GeoJsonResponse, conflicts
from skyway.runtime.http.app import read_json, takes_bytes
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.openapi_document import body_of
from skyway.runtime.http.paging import Page, PageQuery, page_of
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.loops import Wake
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition.closures.closure import Impact
from skyway_composition.closures.network_weather import ClosedNow
from skyway_composition.closures.store import forecast_key, in_force
from skyway_composition.networks import store
from skyway_composition.networks.change_weather import WeatherChanges
from skyway_composition.networks.prepared import PreparedNetworks, current_row
from skyway_composition.networks.publish import etag, publish, read_content
from skyway_composition.networks.service_status import (
    CountDrones,
    NetworkStatus,
    closed_to_models,
    status_of,
    without_counts,
)
from skyway_composition.networks.store import VersionRow

#: The most bytes of a network (docs/reference/rest.md).
NETWORK_LIMIT_BYTES: Final = 256 * 1024 * 1024
#: The last version that the database can number.
MAX_VERSION: Final = 2**31 - 1


class NetworkInfo(JsonModel):
    """A version of a network."""

    network_id: Annotated[NetworkId, Field(description="Id of the network.")]
    version: Annotated[int, Field(description="Number of the version, from 1.", examples=[1])]
    sha256: Annotated[str, Field(description="SHA-256 of the stored GeoJSON, 64 hex digits.")]
    published_at: Annotated[
        datetime, Field(description="When the version was published, fleet time.")
    ]


VersionNumber = Annotated[
    int | None,
    Field(
        ge=1, le=MAX_VERSION, description="Number of the version; without it the current version."
    ),
]


class VersionQuery(QueryModel):
    """Which version of a network is read."""

    version: VersionNumber = None


def network_routes(
    *,
    db: Database,
    gate: ServiceGate,
    networks: PreparedNetworks,
    clock: FleetClock,
    published: Wake,
    impact: Impact,
) -> ServiceRouter:
    """/v1/networks, a network, and its versions."""
    router = ServiceRouter(tags=("networks",))

    @router.put(
        "/v1/networks/{network_id}",
        response_model=NetworkInfo,
        responses={
            201: {"model": NetworkInfo, "description": "The content is new: another version"},
            **conflicts("STATION_ELSEWHERE", "STATION_RESERVED"),
        },
        openapi_extra=body_of(NetworkDocument),
    )
    @takes_bytes(NETWORK_LIMIT_BYTES)
    async def publish_network(
        network_id: NetworkId,
        request: Request,
        response: Response,
        caller: Annotated[Caller, Depends(gate)],
        if_match: Annotated[str | None, Header()] = None,
    ) -> NetworkInfo:
        """Publish a network as GeoJSON; the same content keeps its version."""
        caller.must_be("operator")
        document = await read_json(request)
        if not isinstance(document, dict):
            raise InvalidNetwork("network", "must be a GeoJSON FeatureCollection")
        content = await read_content(document)
        done = await publish(
            db,
            network_id,
            content=content,
            if_match=if_match,
            now_ms=moment_to_ms(clock.now()),
            networks=networks,
            impact=impact,
        )
        published.set()
        response.status_code = 201 if done.is_new else 200
        response.headers["ETag"] = etag(done.row)
        return _info(done.row)

    @router.get("/v1/networks")
    async def list_networks(
        caller: Annotated[Caller, Depends(gate)], query: Annotated[PageQuery, Query()]
    ) -> Page[NetworkInfo]:
        """List all networks with their current versions."""
        _must_be_reader(caller)
        async with db.read() as connection:
            rows = await store.current_after(
                connection,
                query.after_id() or "",
                without=networks.own.foreign,
                limit=query.limit + 1,
            )
        return page_of(rows, query, item=_info, sort_key=lambda row: (row.network_id,))

    @router.get(
        "/v1/networks/{network_id}",
        response_class=GeoJsonResponse,
        response_model=NetworkDocument,
    )
    async def get_network(
        network_id: NetworkId,
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[VersionQuery, Query()],
    ) -> Response:
        """Read a network as GeoJSON, with its version as ETag."""
        _must_be_reader(caller)
        current = await current_row(db, network_id)
        version = current.version if query.version is None else query.version
        async with db.read() as connection:
            content = await store.content(connection, network_id, version)
            rows = await store.versions_before(connection, network_id, before=version + 1, limit=1)
        if content is None:
            raise NotFound("network version", f"{network_id}/{version}")
        return Response(content, media_type=GEOJSON, headers={"ETag": etag(rows[0])})

    @router.get("/v1/networks/{network_id}/versions")
    async def list_network_versions(
        network_id: NetworkId,
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[PageQuery, Query()],
    ) -> Page[NetworkInfo]:
        """List all versions of a network, the newest first."""
        _must_be_reader(caller)
        current = await current_row(db, network_id)
        after = query.after(int)
        newest = current.version + 1
        # An invented cursor may be larger than any number of the database.
        before = max(0, min(int(after[0]), newest)) if after else newest
        async with db.read() as connection:
            rows = await store.versions_before(
                connection, network_id, before=before, limit=query.limit + 1
            )
        return page_of(rows, query, item=_info, sort_key=lambda row: (row.version,))

    return router


def _must_be_reader(caller: Caller) -> None:
    caller.must_be("customer", "provider", "operator", "service")


def _info(row: VersionRow) -> NetworkInfo:
    return NetworkInfo(
        network_id=row.network_id,
        version=row.version,
        sha256=row.sha256,
        published_at=ms_to_moment(row.published_ms),
    )


def service_status_routes(
    *,
    db: Database,
    gate: ServiceGate,
    networks: PreparedNetworks,
    clock: FleetClock,
    count_drones: CountDrones,
) -> ServiceRouter:
    """GET /v1/networks/{network_id}/status."""
    router = ServiceRouter(tags=("networks",))

    @router.get("/v1/networks/{network_id}/status")
    async def get_network_status(
        network_id: NetworkId, caller: Annotated[Caller, Depends(gate)]
    ) -> NetworkStatus:
        """Show whether the network accepts deliveries now, and what restricts it.

        Only operators see how many drones there are.
        """
        caller.must_be("customer", "provider", "operator", "service")
        await current_row(db, network_id)
        drones = await count_drones(network_id)
        now_ms = moment_to_ms(clock.now())
        async with db.read() as connection:
            closures = await in_force(connection, network_id, after_ms=now_ms)
            has_forecast = await forecast_key(connection, network_id) is not None
        windy: dict[DroneModelId, ClosedNow] = {}
        if has_forecast:
            skyway = await networks.current(network_id)
            _, conditions = await skyway.conditions.read(db, after_ms=now_ms)
            windy = await closed_to_models(conditions.weather, drones, now_ms=now_ms)
        present = [each for each in closures if each.is_in_force(now_ms)]
        status = status_of(network_id, present, drones, now_ms=now_ms, windy=windy)
        return status if caller.role == "operator" else without_counts(status)

    return router


#: The most bytes of a forecast (docs/reference/rest.md).
FORECAST_LIMIT_BYTES: Final = 16 * 1024 * 1024


def weather_routes(*, gate: ServiceGate, changes: WeatherChanges) -> ServiceRouter:
    """PUT, GET and DELETE of a network's forecast."""
    router = ServiceRouter(tags=("networks",))
    path = "/v1/networks/{network_id}/weather"

    @router.put(
        path,
        response_model=WeatherInForce,
        responses=NOT_FOUND,
        openapi_extra=body_of(ForecastDocument),
    )
    @takes_bytes(FORECAST_LIMIT_BYTES)
    async def put_network_weather(
        network_id: NetworkId, request: Request, caller: Annotated[Caller, Depends(gate)]
    ) -> WeatherInForce:
        """Replace the weather forecast of the network; the same content changes nothing."""
        caller.must_be("operator")
        document = await read_json(request)
        return await changes.put(network_id, await asyncio.to_thread(_read, document))

    @router.get(path, responses=NOT_FOUND)
    async def get_network_weather(
        network_id: NetworkId, caller: Annotated[Caller, Depends(gate)]
    ) -> WeatherInForce:
        """Show the forecast or the measured wind of the network, and how old it is."""
        caller.must_be("customer", "provider", "operator", "service")
        return await changes.in_force(network_id)

    @router.delete(path, status_code=204)
    async def delete_network_weather(
        network_id: NetworkId, caller: Annotated[Caller, Depends(gate)]
    ) -> None:
        """Remove the weather of the network: plans assume still air until drones measure wind."""
        caller.must_be("operator")
        await changes.remove(network_id)

    return router


def _read(document: object) -> ForecastDocument:
    try:
        return ForecastDocument.model_validate(document)
    except ValidationError as error:
        field, detail = fault_of(error.errors(include_url=False, include_input=False)[0])
        raise InvalidInput(field or "forecast", detail) from error
