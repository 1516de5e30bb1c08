"""A page of what a drone measured, in the resolution that is asked for or fits."""

from dataclasses import replace

from skyway.ids import DroneId
from skyway.runtime.http.paging import Page, page_of
from skyway.runtime.sql.database import Database
from skyway_provider_registry.telemetry import store
from skyway_provider_registry.telemetry.reading.measured import Measured, minute_of, sample_of
from skyway_provider_registry.telemetry.reading.query import LONGEST_PAGE, TelemetryQuery


async def page_of_telemetry(
    db: Database, drone_id: DroneId, query: TelemetryQuery
) -> Page[Measured]:
    """What this drone measured in this time, the oldest first."""
    async with db.survey() as connection:
        resolution = query.known_resolution
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
        item=sample_of if resolution == "raw" else minute_of,
        sort_key=lambda row: (resolution, row.at_ms),
    )
