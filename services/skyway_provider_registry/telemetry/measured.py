"""Telemetry as it is shown: samples or minutes, as JSON or as GeoJSON.

GeoJSON has points, not one line: QGIS and kepler colour, filter and play points by an attribute and
a time.
"""

from typing import Annotated, Any, Final

from pydantic import Field

from skyway.contracts.message import FleetMoment, Soc, utc_text
from skyway.geo import Position
from skyway.ids import DroneId
from skyway.json_model import JsonModel
from skyway.runtime.http.paging import Page
from skyway.runtime.sql.connection import AnyRow
from skyway.units import ms_to_moment


class Spread(JsonModel):
    """The samples of a minute: their number, and the least and largest values."""

    samples: Annotated[int, Field(ge=1, description="number of samples in this minute")]
    min_soc: Annotated[Soc, Field(description="least state of charge, 0 to 1")]
    max_soc: Annotated[Soc, Field(description="largest state of charge, 0 to 1")]
    min_power_w: Annotated[float, Field(description="least electrical power, watts")]
    max_power_w: Annotated[float, Field(description="largest electrical power, watts")]
    min_speed_mps: Annotated[float, Field(description="least ground speed, metres per second")]
    max_speed_mps: Annotated[float, Field(description="largest ground speed, metres per second")]


class Measured(JsonModel):
    """A sample, or the means and the last position of the minute that begins at `at`.

    `spread` is null for a sample; voltage, temperature and range are null for a minute.
    """

    at: Annotated[
        FleetMoment, Field(description="moment of the sample or start of the minute, fleet time")
    ]
    position: Annotated[Position, Field(description="longitude and latitude, degrees")]
    soc: Annotated[Soc, Field(description="state of charge, 0 to 1")]
    power_w: Annotated[float, Field(description="electrical power drawn from the battery, watts")]
    speed_mps: Annotated[float, Field(description="speed over ground, metres per second")]
    voltage_v: Annotated[float | None, Field(description="battery voltage, volts")] = None
    temperature_c: Annotated[
        float | None, Field(description="battery temperature, degrees Celsius")
    ] = None
    range_m: Annotated[
        float | None, Field(description="distance that the drone can still fly, metres")
    ] = None
    spread: Annotated[Spread | None, Field(description="least and largest values of a minute")] = (
        None
    )


def sample_of(row: AnyRow) -> Measured:
    """A row of samples."""
    return Measured.model_construct(
        at=ms_to_moment(row.at_ms),
        position=Position(row.longitude_deg, row.latitude_deg),
        soc=row.soc,
        power_w=row.power_w,
        speed_mps=row.speed_mps,
        voltage_v=row.voltage_v,
        temperature_c=row.temperature_c,
        range_m=row.range_m,
    )


def minute_of(row: AnyRow) -> Measured:
    """A row of minutes."""
    return Measured.model_construct(
        at=ms_to_moment(row.at_ms),
        position=Position(row.longitude_deg, row.latitude_deg),
        soc=row.soc,
        power_w=row.power_w,
        speed_mps=row.speed_mps,
        spread=Spread.model_construct(
            samples=row.samples,
            min_soc=row.min_soc,
            max_soc=row.max_soc,
            min_power_w=row.min_power_w,
            max_power_w=row.max_power_w,
            min_speed_mps=row.min_speed_mps,
            max_speed_mps=row.max_speed_mps,
        ),
    )


GEOJSON: Final = "application/geo+json"

_NOT_FLAT: Final = {"at", "position", "spread"}


def feature_collection(drone_id: DroneId, page: Page[Measured]) -> dict[str, Any]:
    """A page as GeoJSON (RFC 7946); `next_cursor` is a foreign member. Any: a JSON document."""
    return {
        "type": "FeatureCollection",
        "features": [_feature(drone_id, item) for item in page.items],
        "next_cursor": page.next_cursor,
    }


def _feature(drone_id: DroneId, item: Measured) -> dict[str, Any]:
    """One point; its properties are flat, because map tools read no nested objects.

    Any: a JSON document.
    """
    properties = {"drone_id": drone_id, "at": utc_text(item.at)}
    properties |= item.model_dump(exclude=_NOT_FLAT, exclude_none=True)
    if item.spread is not None:
        properties |= item.spread.model_dump()
    point = {"type": "Point", "coordinates": list(item.position)}
    return {"type": "Feature", "geometry": point, "properties": properties}
