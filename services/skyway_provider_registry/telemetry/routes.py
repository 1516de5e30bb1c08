"""Telemetry over REST: a provider reads that of its drones, a drone its own."""

from typing import Annotated, Any, Final, Literal

from fastapi import Depends, Header, Query, Response
from pydantic import Field

from skyway.contracts.message import FleetMoment, Soc
from skyway.geo import Position
from skyway.ids import DroneId, ProviderId
from skyway.json_model import JsonModel
from skyway.runtime.http.answers import GeoJsonResponse
from skyway.runtime.http.identity import Caller
from skyway.runtime.http.openapi_document import schema_of
from skyway.runtime.http.paging import Page
from skyway.runtime.http.service_router import ServiceRouter
from skyway_provider_registry.context import Context
from skyway_provider_registry.fleets import store as fleets
from skyway_provider_registry.telemetry.page import (
    GEOJSON,
    Measured,
    TelemetryQuery,
    feature_collection,
    page_of_telemetry,
)

_OfMinute = Field(description="Of a minute only, over its samples.")


class MeasuredPoint(JsonModel):
    """Where the drone was."""

    type: Annotated[Literal["Point"], Field(description="Always Point.")]
    coordinates: Annotated[Position, Field(description="Longitude and latitude in degrees.")]


class MeasuredProperties(JsonModel):
    """What the drone measured there; a property that was not measured is missing."""

    drone_id: DroneId
    at: FleetMoment
    soc: Annotated[Soc, Field(description="State of charge, 0 to 1.")]
    power_w: Annotated[float, Field(description="Electrical power in watts.")]
    speed_mps: Annotated[float, Field(description="Speed over ground in metres per second.")]
    voltage_v: Annotated[float | None, Field(description="Battery voltage in volts.")] = None
    temperature_c: Annotated[
        float | None, Field(description="Battery temperature in degrees Celsius.")
    ] = None
    range_m: Annotated[
        float | None, Field(description="How far the drone can still fly, in metres.")
    ] = None
    samples: Annotated[int | None, Field(description="How many samples the minute has.")] = None
    min_soc: Annotated[float | None, _OfMinute] = None
    max_soc: Annotated[float | None, _OfMinute] = None
    min_power_w: Annotated[float | None, _OfMinute] = None
    max_power_w: Annotated[float | None, _OfMinute] = None
    min_speed_mps: Annotated[float | None, _OfMinute] = None
    max_speed_mps: Annotated[float | None, _OfMinute] = None


class MeasuredFeature(JsonModel):
    """A sample, or a minute of samples, as a GeoJSON feature."""

    type: Annotated[Literal["Feature"], Field(description="Always Feature.")]
    geometry: Annotated[MeasuredPoint, Field(description="Where the drone was.")]
    properties: Annotated[MeasuredProperties, Field(description="What the drone measured.")]


class TelemetryGeoJson(JsonModel):
    """A page of telemetry as a GeoJSON FeatureCollection (RFC 7946)."""

    type: Annotated[Literal["FeatureCollection"], Field(description="Always FeatureCollection.")]
    features: Annotated[tuple[MeasuredFeature, ...], Field(description="The oldest first.")]
    next_cursor: Annotated[
        str | None, Field(description="The `cursor` of the next page; null on the last page.")
    ]


#: A part of the OpenAPI document.
_ANSWERS: Final[dict[int | str, dict[str, Any]]] = {
    200: {"content": {GEOJSON: {"schema": schema_of(TelemetryGeoJson)}}}
}


def telemetry_routes(context: Context) -> ServiceRouter:
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
        caller: Annotated[Caller, Depends(context.gate)],
        query: Annotated[TelemetryQuery, Query()],
        accept: Annotated[str, Header()] = "",
    ) -> Response:
        """List what a drone measured, the oldest first: samples or minutes, JSON or GeoJSON."""
        caller.must_be("operator", "provider", "drone")
        async with context.db.read() as connection:
            await fleets.of_caller(connection, caller, provider_id=provider_id, drone_id=drone_id)
        page = await page_of_telemetry(context.db, drone_id, query)
        if query.format == "geojson" or (query.format is None and GEOJSON in accept):
            return GeoJsonResponse(feature_collection(drone_id, page))
        # As bytes: FastAPI would check each of thousands of rows again.
        return Response(page.model_dump_json(), media_type="application/json")

    return router
