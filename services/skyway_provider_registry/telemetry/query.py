"""A query of a drone's telemetry, and the page that answers it."""

from dataclasses import replace
from typing import Annotated, Final, Literal

from pydantic import Field

from skyway.contracts.message import FleetMoment
from skyway.errors import InvalidInput
from skyway.ids import DroneId
from skyway.runtime.http.paging import Page, PageQuery, page_of
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms
from skyway_provider_registry.telemetry import store
from skyway_provider_registry.telemetry.measured import Measured, minute_of, sample_of
from skyway_provider_registry.telemetry.store import MINUTE_MS, Span

Resolution = Literal["raw", "minute"]

#: The longest page; `auto` shows a period with more samples by minutes.
LONGEST_PAGE: Final = 2_000
_EVER_MS: Final = 2**62


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
        item=sample_of if resolution == "raw" else minute_of,
        sort_key=lambda row: (resolution, row.at_ms),
    )
