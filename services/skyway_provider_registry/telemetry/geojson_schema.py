"""The GeoJSON of telemetry as models: what the API's document shows."""

from typing import Annotated, Literal

from pydantic import Field

from skyway.contracts.message import FleetMoment, Soc
from skyway.geo import Position
from skyway.ids import DroneId
from skyway.json_model import JsonModel

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
