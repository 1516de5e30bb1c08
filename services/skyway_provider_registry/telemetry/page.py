"""A query of a drone's telemetry, and its answer: samples or minutes, as JSON or as GeoJSON.

GeoJSON has points, not one line: QGIS and kepler colour, filter and play points by an attribute and
a time.
"""

from dataclasses import replace
from typing import Annotated, Any, Final, Literal

from pydantic import Field

from skyway.contracts.message import FleetMoment, Soc, utc_text
from skyway.errors import InvalidInput
from skyway.geo import Position
from skyway.ids import DroneId
from skyway.json_model import JsonModel
from skyway.runtime.http.paging import Page, PageQuery, page_of
from skyway.runtime.sql.connection import AnyRow
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms, ms_to_moment
from skyway_provider_registry.telemetry import store
from skyway_provider_registry.telemetry.store import MINUTE_MS, Span

Resolution = Literal["raw", "minute"]

#: The longest page; `auto` shows a period with more samples by minutes.
LONGEST_PAGE: Final = 2_000
_EVER_MS: Final = 2**62

GEOJSON: Final = "application/geo+json"
_NOT_FLAT: Final = {"at", "position", "spread"}


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


class TelemetryQuery(PageQuery):
    """``?from=&until=&resolution=&format=&limit=&cursor=``; without a period, all telemetry."""

    from_at: Annotated[
        FleetMoment | None,
        Field(alias="from", description="the first moment, fleet time; all when left out"),
    ] = None
    until_at: Annotated[
        FleetMoment | None,
        Field(alias="until", description="end of the period, itself excluded, fleet time"),
    ] = None
    resolution: Annotated[
        Literal["raw", "minute", "auto"],
        Field(
            description="raw: samples; minute: averages; auto: samples when all are stored and"
            f" there are at most {LONGEST_PAGE}"
        ),
    ] = "auto"
    format: Annotated[
        Literal["json", "geojson"] | None,
        Field(description="format of the answer; without it the header Accept decides"),
    ] = None
    limit: Annotated[
        int, Field(ge=1, le=LONGEST_PAGE, description=f"most items of a page, 1 to {LONGEST_PAGE}")
    ] = 500

    @property
    def fixed_resolution(self) -> Resolution | None:
        """The requested resolution, or that of the first page; None when it is not chosen yet."""
        if (after := self._after()) is not None:
            return after[0]
        return None if self.resolution == "auto" else self.resolution

    def span(self, resolution: Resolution) -> Span:
        """The rows of this page, and one more."""
        from_ms = 0 if self.from_at is None else moment_to_ms(self.from_at)
        until_ms = _EVER_MS if self.until_at is None else moment_to_ms(self.until_at)
        step_ms = 1
        if resolution == "minute":
            # Whole minutes only: half a minute would have other averages.
            step_ms = MINUTE_MS
            from_ms -= from_ms % MINUTE_MS
            until_ms += -until_ms % MINUTE_MS
        if (after := self._after()) is not None:
            from_ms = max(from_ms, after[1] + step_ms)
        return Span(from_ms, until_ms, self.limit + 1)

    def _after(self) -> tuple[Resolution, int] | None:
        """The resolution of the cursor's list, and the moment of the last row before it."""
        after = super().after(str, int)
        if after is None:
            return None
        resolution, at_ms = after
        if self.resolution in (resolution, "auto") and 0 <= int(at_ms) < _EVER_MS:
            if resolution == "raw":
                return "raw", int(at_ms)
            if resolution == "minute":
                return "minute", int(at_ms)
        raise InvalidInput("cursor", "not a cursor of this list")


async def page_of_telemetry(
    db: Database, drone_id: DroneId, query: TelemetryQuery
) -> Page[Measured]:
    """The drone's telemetry of this period, the oldest first."""
    async with db.survey() as connection:
        resolution = query.fixed_resolution
        if resolution is None:
            whole = replace(query.span("raw"), most=LONGEST_PAGE)
            is_raw = await store.has_all_samples(connection, drone_id, whole)
            resolution = "raw" if is_raw else "minute"
        span = query.span(resolution)
        if resolution == "raw":
            rows = await store.samples_between(connection, drone_id, span)
        else:
            rows = await store.minutes_between(connection, drone_id, span)
    return page_of(
        rows,
        query,
        item=_sample_of if resolution == "raw" else _minute_of,
        sort_key=lambda row: (resolution, row.at_ms),
    )


def feature_collection(drone_id: DroneId, page: Page[Measured]) -> dict[str, Any]:
    """A page as GeoJSON (RFC 7946); `next_cursor` is a foreign member. Any: a JSON document."""
    return {
        "type": "FeatureCollection",
        "features": [_feature(drone_id, item) for item in page.items],
        "next_cursor": page.next_cursor,
    }


def _sample_of(row: AnyRow) -> Measured:
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


def _minute_of(row: AnyRow) -> Measured:
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
