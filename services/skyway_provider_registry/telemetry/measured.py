"""What a drone measured, as it is shown: one sample, or a minute of them."""

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
    """The samples of a minute: how many, and between which values."""

    samples: Annotated[int, Field(ge=1)]
    min_soc: Soc
    max_soc: Soc
    min_power_w: float
    max_power_w: float
    min_speed_mps: float
    max_speed_mps: float


class Measured(JsonModel):
    """A sample; or the minute that begins at `at`, with its means and its last position.

    `spread` is null for a sample; voltage, temperature and range are null for a minute.
    """

    at: FleetMoment
    position: Position
    soc: Soc
    power_w: float
    speed_mps: float
    voltage_v: float | None = None
    temperature_c: float | None = None
    range_m: float | None = None
    spread: Spread | None = None


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

_BESIDE: Final = {"at", "position", "spread"}


def feature_collection(drone_id: DroneId, page: Page[Measured]) -> dict[str, Any]:
    """A page as GeoJSON (RFC 7946); `next_cursor` is a foreign member. Any: a JSON document."""
    return {
        "type": "FeatureCollection",
        "features": [_feature(drone_id, item) for item in page.items],
        "next_cursor": page.next_cursor,
    }


def _feature(drone_id: DroneId, item: Measured) -> dict[str, Any]:
    """One point; what a minute spreads over stands beside its means, since tools read no objects.

    Any: a JSON document.
    """
    properties = {"drone_id": drone_id, "at": utc_text(item.at)}
    properties |= item.model_dump(exclude=_BESIDE, exclude_none=True)
    if item.spread is not None:
        properties |= item.spread.model_dump()
    point = {"type": "Point", "coordinates": list(item.position)}
    return {"type": "Feature", "geometry": point, "properties": properties}
