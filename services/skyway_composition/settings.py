"""The settings that composition reads from its environment."""

from typing import Annotated

from pydantic import Field, ValidationInfo, field_validator

from skyway.cells import CellSettings


class CompositionSettings(CellSettings):
    """`CellSettings`, the limits of planning, and how long closures and alarms are kept."""

    port: int = Field(
        default=8002,
        ge=0,
        le=65535,
        description="Port on which it listens. 0 takes any free port.",
    )
    cell_url: str | None = Field(
        default=None,
        description="The address of this composition, as it stands in `SKYWAY_CELLS`. Without it "
        "this composition is that of `SKYWAY_COMPOSITION_URL`.",
    )
    solver_threads: Annotated[
        int,
        Field(
            ge=1,
            le=64,
            description="Threads that plan bookings, as many for quotes, and as many for "
            "`POST /v1/compositions`.",
        ),
    ] = 2
    solver_time_limit_s: Annotated[
        float,
        Field(
            gt=0,
            description="Seconds of wall time after which the search for one plan ends with the "
            "best plan found.",
        ),
    ] = 5.0
    dispatch_every_s: float = Field(
        default=10.0,
        ge=0.0,
        le=3_600.0,
        description="Seconds of wall time between two looks of the dispatcher at what waits in "
        "calendars. With 0 there is no dispatcher.",
    )
    dispatch_budget_s: float = Field(
        default=0.3,
        ge=0.01,
        le=600.0,
        description="Seconds of processor time for one search of the dispatcher; it makes up to "
        "three in a row.",
    )
    dispatch_tolerance_s: float = Field(
        default=60.0,
        ge=0.0,
        le=86_400.0,
        description="Seconds of fleet time by which the dispatcher may deliver after a promise, "
        "unless the customer allows more.",
    )
    strategies: str = Field(
        default="exact,heuristic",
        description="Strategies, separated by commas, that everybody may ask for in "
        "`POST /v1/compositions`. Operators may ask for all.",
    )
    closure_days: float | None = Field(
        default=None,
        ge=1.0,
        le=36_500.0,
        description="Days of fleet time for which closures, zones, outages and ground stops are "
        "kept after their end. Without it they are kept for ever.",
    )
    alarm_days: float | None = Field(
        default=None,
        ge=1.0,
        le=36_500.0,
        description="Days of fleet time for which alarms are kept after an operator has "
        "acknowledged them. Without it they are kept for ever.",
    )
    network_version_days: float | None = Field(
        default=None,
        ge=1.0,
        le=36_500.0,
        description="Days of fleet time for which a version of a network is kept after a newer "
        "version has replaced it. Without it all versions are kept for ever.",
    )

    @field_validator("cell_url")
    @classmethod
    def _serves_networks(cls, url: str | None, info: ValidationInfo) -> str | None:
        """Refuse an address to which no service sends requests."""
        default, cells = info.data.get("composition_url", ""), info.data.get("cells", {})
        url = None if url is None else url.rstrip("/")
        if url not in (None, default.rstrip("/"), *cells.values()):
            raise ValueError(
                f"{url} serves no network: it is neither SKYWAY_COMPOSITION_URL ({default}) nor "
                f"in SKYWAY_CELLS ({', '.join(cells.values()) or 'which is empty'})"
            )
        return url
