"""Closures over REST: of stations, pads, segments and zones, and ground stops.

All kinds together are read for a past or coming time.
"""

from datetime import datetime, timedelta
from typing import Annotated, Final

from fastapi import Depends, Path, Query, Response
from pydantic import Field

from skyway.bounds import EARLIEST
from skyway.contracts.message import FleetMoment
from skyway.contracts.statistics import Span, span_between
from skyway.ids import ClosureId, StationId
from skyway.json_model import QueryModel
from skyway.network.network import MAX_PADS
from skyway.runtime.errors import NotFound
from skyway.runtime.http.answers import NOT_FOUND
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.paging import Page, PageQuery, page_of
from skyway.runtime.http.service_router import ServiceRouter
from skyway_composition.closures import store
from skyway_composition.closures.close import Closings
from skyway_composition.closures.handle_orders import (
    MADE,
    ClosureInfo,
    ClosureMade,
    ClosureOrder,
    ClosureQuery,
    DryRun,
    GroundStopOrder,
    ZoneOrder,
    closure_of,
    lift,
    make_or_preview,
    page_of_kind,
    shown,
    status_of,
)

PadNumber = Annotated[int, Path(ge=0, lt=MAX_PADS, description="The number of the pad, from 0.")]


def place_routes(*, gate: ServiceGate, closings: Closings) -> ServiceRouter:
    """Closures of stations, outages of pads, closures of segments."""
    router = ServiceRouter(tags=("closures",))
    _add_stations(router, gate, closings)
    _add_outages(router, gate, closings)
    _add_segment_closures(router, gate, closings)
    return router


def _add_stations(router: ServiceRouter, gate: ServiceGate, closings: Closings) -> None:
    path = "/v1/stations/{station_id}/closures"

    @router.post(path, response_model=ClosureMade, responses=MADE)
    async def create_station_closure(
        station_id: StationId,
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[DryRun, Query()],
        response: Response,
        order: ClosureOrder | None = None,
    ) -> ClosureMade:
        """Close a station; drones that plan to land there get a new plan."""
        caller.must_be("operator")
        at = await closings.around(station_id)
        closure = closure_of("STATION", at.network_id, closings, order, station_id=station_id)
        response.status_code = status_of(query)
        return await make_or_preview(closings, closure, query)

    @router.get(path)
    async def list_station_closures(
        station_id: StationId,
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[ClosureQuery, Query()],
    ) -> Page[ClosureInfo]:
        """List the closures of a station, by default those that are not over."""
        return await page_of_kind(closings, caller, query, "STATION", station_id=station_id)

    @router.delete(f"{path}/{{closure_id}}", status_code=204)
    async def delete_station_closure(
        station_id: StationId, closure_id: ClosureId, caller: Annotated[Caller, Depends(gate)]
    ) -> None:
        """Lift a closure of a station."""
        await lift(closings, caller, closure_id, "STATION", station_id=station_id)


def _add_outages(router: ServiceRouter, gate: ServiceGate, closings: Closings) -> None:
    path = "/v1/stations/{station_id}/pads/{pad}/outages"

    @router.post(path, response_model=ClosureMade, responses=MADE)
    async def create_pad_outage(
        station_id: StationId,
        pad: PadNumber,
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[DryRun, Query()],
        response: Response,
        order: ClosureOrder | None = None,
    ) -> ClosureMade:
        """Put a pad out of order; drones that plan to charge there get a new plan."""
        caller.must_be("operator")
        at = await closings.around(station_id)
        if pad >= at.network.stations[station_id].pads:
            raise NotFound("pad", f"{station_id}/{pad}")
        closure = closure_of("PAD", at.network_id, closings, order, station_id=station_id, pad=pad)
        response.status_code = status_of(query)
        return await make_or_preview(closings, closure, query)

    @router.get(path)
    async def list_pad_outages(
        station_id: StationId,
        pad: PadNumber,
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[ClosureQuery, Query()],
    ) -> Page[ClosureInfo]:
        """List the outages of a pad, by default those that are not over."""
        return await page_of_kind(closings, caller, query, "PAD", station_id=station_id, pad=pad)

    @router.delete(f"{path}/{{closure_id}}", status_code=204)
    async def delete_pad_outage(
        station_id: StationId,
        pad: PadNumber,
        closure_id: ClosureId,
        caller: Annotated[Caller, Depends(gate)],
    ) -> None:
        """End an outage of a pad."""
        await lift(closings, caller, closure_id, "PAD", station_id=station_id, pad=pad)


def _add_segment_closures(router: ServiceRouter, gate: ServiceGate, closings: Closings) -> None:
    path = "/v1/segments/{from_id}/{to_id}/closures"

    @router.post(path, response_model=ClosureMade, responses=MADE)
    async def create_segment_closure(
        from_id: StationId,
        to_id: StationId,
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[DryRun, Query()],
        response: Response,
        order: ClosureOrder | None = None,
    ) -> ClosureMade:
        """Close a segment in this direction; drones that plan to fly it get a new plan."""
        caller.must_be("operator")
        at = await closings.around(from_id)
        if all(segment.to_id != to_id for segment in at.network.segments_from(from_id)):
            raise NotFound("segment", f"{from_id}/{to_id}")
        closure = closure_of(
            "SEGMENT", at.network_id, closings, order, station_id=from_id, to_station_id=to_id
        )
        response.status_code = status_of(query)
        return await make_or_preview(closings, closure, query)

    @router.get(path)
    async def list_segment_closures(
        from_id: StationId,
        to_id: StationId,
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[ClosureQuery, Query()],
    ) -> Page[ClosureInfo]:
        """List the closures of a segment, by default those that are not over."""
        return await page_of_kind(
            closings, caller, query, "SEGMENT", station_id=from_id, to_station_id=to_id
        )

    @router.delete(f"{path}/{{closure_id}}", status_code=204)
    async def delete_segment_closure(
        from_id: StationId,
        to_id: StationId,
        closure_id: ClosureId,
        caller: Annotated[Caller, Depends(gate)],
    ) -> None:
        """Lift a closure of a segment."""
        await lift(closings, caller, closure_id, "SEGMENT", station_id=from_id, to_station_id=to_id)


def area_routes(*, gate: ServiceGate, closings: Closings) -> ServiceRouter:
    """Zones, and ground stops in an area, in a network or everywhere."""
    router = ServiceRouter(tags=("closures",))
    _add_zones(router, gate, closings)
    _add_ground_stops(router, gate, closings)
    return router


def _add_zones(router: ServiceRouter, gate: ServiceGate, closings: Closings) -> None:
    @router.post("/v1/zones", response_model=ClosureMade, responses={**MADE, **NOT_FOUND})
    async def create_zone(
        order: ZoneOrder,
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[DryRun, Query()],
        response: Response,
    ) -> ClosureMade:
        """Close an area: no drone may fly through it or land in it."""
        caller.must_be("operator")
        closure = closure_of("ZONE", order.network_id, closings, order, area=order.area)
        response.status_code = status_of(query)
        return await make_or_preview(closings, closure, query)

    @router.get("/v1/zones")
    async def list_zones(
        caller: Annotated[Caller, Depends(gate)], query: Annotated[ClosureQuery, Query()]
    ) -> Page[ClosureInfo]:
        """List the zones that operators made, by default those that are not over."""
        return await page_of_kind(closings, caller, query, "ZONE")

    @router.delete("/v1/zones/{closure_id}", status_code=204)
    async def delete_zone(closure_id: ClosureId, caller: Annotated[Caller, Depends(gate)]) -> None:
        """Lift a zone."""
        await lift(closings, caller, closure_id, "ZONE")


def _add_ground_stops(router: ServiceRouter, gate: ServiceGate, closings: Closings) -> None:
    @router.post("/v1/ground-stops", response_model=ClosureMade, responses={**MADE, **NOT_FOUND})
    async def create_ground_stop(
        order: GroundStopOrder,
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[DryRun, Query()],
        response: Response,
    ) -> ClosureMade:
        """Forbid drones to take off; drones in the air land as planned."""
        caller.must_be("operator")
        closure = closure_of(
            "GROUND_STOP",
            order.network_id,
            closings,
            ClosureOrder(until=order.until, reason=order.reason),
            area=order.area,
            provider_id=order.provider_id,
            drone_model_id=order.drone_model_id,
        )
        response.status_code = status_of(query)
        return await make_or_preview(closings, closure, query)

    @router.get("/v1/ground-stops")
    async def list_ground_stops(
        caller: Annotated[Caller, Depends(gate)], query: Annotated[ClosureQuery, Query()]
    ) -> Page[ClosureInfo]:
        """List the ground stops, by default those that are not over."""
        return await page_of_kind(closings, caller, query, "GROUND_STOP")

    @router.delete("/v1/ground-stops/{closure_id}", status_code=204)
    async def delete_ground_stop(
        closure_id: ClosureId, caller: Annotated[Caller, Depends(gate)]
    ) -> None:
        """Lift a ground stop, so that drones may take off again."""
        await lift(closings, caller, closure_id, "GROUND_STOP")


#: The longest span of one call. Our own choice.
LONGEST_REPLAY: Final = timedelta(days=1)

_DEFAULT: Final = timedelta(hours=1)


class PastSpanQuery(QueryModel):
    """``?from=&to=``: up to now, and an hour, unless said otherwise."""

    from_at: Annotated[
        FleetMoment | None,
        Field(alias="from", description="Start of the span, fleet time; without it an hour."),
    ] = None
    to_at: Annotated[
        FleetMoment | None,
        Field(
            alias="to",
            description="End of the span, fleet time; without it now. A span is at most a day.",
        ),
    ] = None

    def span(self, now: datetime) -> Span:
        """The span that is meant.

        Raises
        ------
        InvalidInput
            It ends before it begins, or it is too long.
        """
        to_at = self.to_at or now
        from_at = self.from_at or max(EARLIEST, to_at - _DEFAULT)
        return span_between(from_at, to_at, longest=LONGEST_REPLAY)


class ClosuresQuery(PastSpanQuery, PageQuery):
    """A span, and a page of the closures in force in it."""


def span_routes(*, gate: ServiceGate, closings: Closings) -> ServiceRouter:
    """GET /v1/closures."""
    router = ServiceRouter(tags=("closures",))

    @router.get("/v1/closures")
    async def list_closures(
        caller: Annotated[Caller, Depends(gate)], query: Annotated[ClosuresQuery, Query()]
    ) -> Page[ClosureInfo]:
        """List the closures of every kind that were in force in a span of at most a day."""
        caller.must_be("customer", "provider", "operator", "service")
        span = query.span(closings.clock.now())
        async with closings.db.read() as connection:
            rows = await store.page_in_span(
                connection, span, after=query.after_id() or "", limit=query.limit + 1
            )
        return page_of(rows, query, item=shown, sort_key=lambda row: (row.closure_id,))

    return router
