"""Telemetry over REST: a provider reads that of its drones, a drone its own."""

from typing import Annotated, Any, Final

from fastapi import Depends, Header, Query, Response

from skyway.ids import DroneId, ProviderId
from skyway.runtime.http.geojson import GeoJsonResponse
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.openapi_document import schema_of
from skyway.runtime.http.paging import Page
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.sql.database import Database
from skyway_provider_registry.fleets import store as fleets
from skyway_provider_registry.telemetry.geojson_schema import TelemetryGeoJson
from skyway_provider_registry.telemetry.measured import GEOJSON, Measured, feature_collection
from skyway_provider_registry.telemetry.query import TelemetryQuery, page_of_telemetry

#: A part of the OpenAPI document.
_ANSWERS: Final[dict[int | str, dict[str, Any]]] = {
    200: {"content": {GEOJSON: {"schema": schema_of(TelemetryGeoJson)}}}
}


def telemetry_routes(*, db: Database, gate: ServiceGate) -> ServiceRouter:
    """GET /v1/providers/{provider_id}/drones/{drone_id}/telemetry."""
    router = ServiceRouter(tags=("drones",))

    @router.get(
        "/v1/providers/{provider_id}/drones/{drone_id}/telemetry",
        response_model=Page[Measured],
        responses=_ANSWERS,
    )
    async def get_drone_telemetry(
        provider_id: ProviderId,
        drone_id: DroneId,
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[TelemetryQuery, Query()],
        accept: Annotated[str, Header()] = "",
    ) -> Response:
        """List what a drone measured, the oldest first: samples or minutes, JSON or GeoJSON."""
        caller.must_be("operator", "provider", "drone")
        async with db.read() as connection:
            await fleets.of_caller(connection, caller, provider_id=provider_id, drone_id=drone_id)
        page = await page_of_telemetry(db, drone_id, query)
        if query.format == "geojson" or (query.format is None and GEOJSON in accept):
            return GeoJsonResponse(feature_collection(drone_id, page))
        # As bytes: FastAPI would check each of thousands of rows again.
        return Response(page.model_dump_json(), media_type="application/json")

    return router
