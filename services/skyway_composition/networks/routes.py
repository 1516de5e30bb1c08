"""Networks and their versions over REST: operators publish them, everybody reads them."""

from datetime import datetime
from typing import Annotated, Any, Final

from fastapi import Depends, Header, Query, Request, Response
from pydantic import Field

from skyway.errors import InvalidNetwork
from skyway.ids import NetworkId
from skyway.json_model import JsonModel
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import NotFound
from skyway.runtime.http.app import read_json
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.paging import Page, PageQuery, page_of
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.loops import Wake
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition.closures.impact import Impact
from skyway_composition.networks import store
from skyway_composition.networks.current import current_row
from skyway_composition.networks.prepared import PreparedNetworks
from skyway_composition.networks.publish import etag, publish, read_content
from skyway_composition.networks.store import VersionRow

#: The most bytes of a network (docs/reference/rest.md).
NETWORK_LIMIT_BYTES: Final = 256 * 1024 * 1024
#: The last version that the database can number.
MAX_VERSION: Final = 2**31 - 1

_GEOJSON: Final = "application/geo+json"
_GEOJSON_BODY: Final[dict[str, Any]] = {  # a part of the OpenAPI document
    "requestBody": {
        "required": True,
        "content": {"application/json": {"schema": {"type": "object"}}},
    }
}


class NetworkInfo(JsonModel):
    """A version of a network; `sha256` is the hash of its content."""

    network_id: NetworkId
    version: int
    sha256: str
    published_at: datetime


class VersionQuery(JsonModel):
    """Which version of a network; without it the current one."""

    version: Annotated[int | None, Field(ge=1, le=MAX_VERSION)] = None


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
        responses={201: {"model": NetworkInfo}},
        openapi_extra=_GEOJSON_BODY,
    )
    async def put_network(
        network_id: NetworkId,
        request: Request,
        response: Response,
        caller: Annotated[Caller, Depends(gate)],
        if_match: Annotated[str | None, Header()] = None,
    ) -> NetworkInfo:
        """Publish a network as GeoJSON; the same content again is the same version."""
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
        """All networks, in their current versions."""
        _must_be_somebody(caller)
        after = query.after(str)
        async with db.read() as connection:
            rows = await store.current_after(
                connection, str(after[0]) if after else "", limit=query.limit + 1
            )
        return page_of(rows, query, item=_info, sort_key=lambda row: (row.network_id,))

    @router.get(
        "/v1/networks/{network_id}",
        response_class=Response,
        responses={200: {"content": {_GEOJSON: {"schema": {"type": "object"}}}}},
    )
    async def get_network(
        network_id: NetworkId,
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[VersionQuery, Query()],
    ) -> Response:
        """A network as GeoJSON, with its version as ETag."""
        _must_be_somebody(caller)
        current = await current_row(db, network_id)
        version = current.version if query.version is None else query.version
        async with db.read() as connection:
            content = await store.content(connection, network_id, version)
            rows = await store.versions_before(connection, network_id, before=version + 1, limit=1)
        if content is None:
            raise NotFound("network version", f"{network_id}/{version}")
        return Response(content, media_type=_GEOJSON, headers={"ETag": etag(rows[0])})

    @router.get("/v1/networks/{network_id}/versions")
    async def list_versions(
        network_id: NetworkId,
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[PageQuery, Query()],
    ) -> Page[NetworkInfo]:
        """All versions of a network, the newest first."""
        _must_be_somebody(caller)
        current = await current_row(db, network_id)
        after = query.after(int)
        newest = current.version + 1
        # A made-up cursor may lie beyond what the database can number.
        before = max(0, min(int(after[0]), newest)) if after else newest
        async with db.read() as connection:
            rows = await store.versions_before(
                connection, network_id, before=before, limit=query.limit + 1
            )
        return page_of(rows, query, item=_info, sort_key=lambda row: (row.version,))

    return router


def _must_be_somebody(caller: Caller) -> None:
    caller.must_be("customer", "provider", "operator", "service")


def _info(row: VersionRow) -> NetworkInfo:
    return NetworkInfo(
        network_id=row.network_id,
        version=row.version,
        sha256=row.sha256,
        published_at=ms_to_moment(row.published_ms),
    )
