"""Segments and zones of networks over REST, as they were published."""

from datetime import datetime
from typing import Annotated, Literal

from fastapi import Depends, Query

from skyway.geo import Position
from skyway.ids import NetworkId, StationId, ZoneId
from skyway.json_model import JsonModel
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.paging import Page, PageQuery, page_of
from skyway.runtime.http.service_router import ServiceRouter
from skyway_composition.networks.prepared import PreparedNetworks


class SegmentInfo(JsonModel):
    """A segment of the current version, in one direction."""

    from_id: StationId
    to_id: StationId
    length_m: float


class ZoneInfo(JsonModel):
    """A zone of the current version, as GeoJSON polygon rings."""

    zone_id: ZoneId
    type: Literal["Polygon"] = "Polygon"
    coordinates: tuple[tuple[Position, ...], ...]
    active_from: datetime | None
    active_until: datetime | None


def airspace_routes(*, gate: ServiceGate, networks: PreparedNetworks) -> ServiceRouter:
    """/v1/networks/{network_id}/segments and .../zones."""
    router = ServiceRouter(tags=("networks",))

    @router.get("/v1/networks/{network_id}/segments")
    async def list_segments(
        network_id: NetworkId,
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[PageQuery, Query()],
    ) -> Page[SegmentInfo]:
        """The segments of the current version, each direction on its own."""
        caller.must_be("customer", "provider", "operator", "service")
        segments = (await networks.current(network_id)).network.segments
        start = _offset(query)
        rows = list(enumerate(segments[start : start + query.limit + 1], start))
        return page_of(
            rows,
            query,
            item=lambda row: SegmentInfo(
                from_id=row[1].from_id, to_id=row[1].to_id, length_m=row[1].length_m
            ),
            sort_key=lambda row: (row[0],),
        )

    @router.get("/v1/networks/{network_id}/zones")
    async def list_zones(
        network_id: NetworkId,
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[PageQuery, Query()],
    ) -> Page[ZoneInfo]:
        """The zones of the current version."""
        caller.must_be("customer", "provider", "operator", "service")
        zones = (await networks.current(network_id)).network.zones
        start = _offset(query)
        rows = list(enumerate(zones[start : start + query.limit + 1], start))
        return page_of(
            rows,
            query,
            item=lambda row: ZoneInfo(
                zone_id=row[1].zone_id,
                coordinates=row[1].rings,
                active_from=row[1].active_from,
                active_until=row[1].active_until,
            ),
            sort_key=lambda row: (row[0],),
        )

    return router


def _offset(query: PageQuery) -> int:
    """The place after the last item seen, in a list that is kept in order."""
    after = query.after(int)
    return max(0, int(after[0]) + 1) if after else 0
