"""Closures over REST: operators make and lift them, everybody sees them."""

from typing import Annotated, Any, Final

from fastapi import Depends, Path, Query, Response

from skyway.ids import ClosureId, NetworkId, StationId
from skyway.network.network import MAX_PADS
from skyway.runtime.errors import NotFound
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.paging import Page, page_of
from skyway.runtime.http.service_router import ServiceRouter
from skyway_composition.closures import store
from skyway_composition.closures.closing import Closings
from skyway_composition.closures.closure import Closure, ClosureKind
from skyway_composition.closures.orders import (
    ClosureInfo,
    ClosureMade,
    ClosureOrder,
    ClosureQuery,
    DryRun,
    GroundStopOrder,
    ZoneOrder,
    made,
    shown,
)
from skyway_composition.closures.store import ClosureFilter

#: Until it is made, a closure has no id.
_NOT_MADE: Final = ClosureId("")

#: How a POST is answered when something was made; 200 is a dry run.
_MADE: Final[dict[int | str, dict[str, Any]]] = {201: {"model": ClosureMade}}

PadNumber = Annotated[int, Path(ge=0, lt=MAX_PADS)]


def closure_routes(*, gate: ServiceGate, closings: Closings) -> ServiceRouter:
    """Closures of stations and segments, outages of pads, zones, ground stops."""
    router = ServiceRouter(tags=("closures",))
    _add_closures(router, gate, closings)
    _add_outages(router, gate, closings)
    _add_segment_closures(router, gate, closings)
    _add_zones(router, gate, closings)
    _add_ground_stops(router, gate, closings)
    return router


def _add_closures(router: ServiceRouter, gate: ServiceGate, closings: Closings) -> None:
    path = "/v1/stations/{station_id}/closures"

    @router.post(path, response_model=ClosureMade, responses=_MADE)
    async def close_station(
        station_id: StationId,
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[DryRun, Query()],
        response: Response,
        order: ClosureOrder | None = None,
    ) -> ClosureMade:
        """Have nobody land at a station, and whoever would, go elsewhere."""
        caller.must_be("operator")
        at = await closings.around(station_id)
        closure = _closure("STATION", at.network_id, closings, order, station_id=station_id)
        return await _make(closings, closure, query, response)

    @router.get(path)
    async def list_station_closures(
        station_id: StationId,
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[ClosureQuery, Query()],
    ) -> Page[ClosureInfo]:
        """The closures of a station that are not over."""
        return await _page(closings, caller, query, "STATION", station_id=station_id)

    @router.delete(f"{path}/{{closure_id}}", status_code=204)
    async def reopen_station(
        station_id: StationId, closure_id: ClosureId, caller: Annotated[Caller, Depends(gate)]
    ) -> None:
        """Lift a closure of a station."""
        await _lift(closings, caller, closure_id, "STATION", station_id=station_id)


def _add_outages(router: ServiceRouter, gate: ServiceGate, closings: Closings) -> None:
    path = "/v1/stations/{station_id}/pads/{pad}/outages"

    @router.post(path, response_model=ClosureMade, responses=_MADE)
    async def put_pad_out_of_order(
        station_id: StationId,
        pad: PadNumber,
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[DryRun, Query()],
        response: Response,
        order: ClosureOrder | None = None,
    ) -> ClosureMade:
        """Have nobody charge on a pad, and whoever would, do so elsewhere."""
        caller.must_be("operator")
        at = await closings.around(station_id)
        if pad >= at.network.stations[station_id].pads:
            raise NotFound("pad", f"{station_id}/{pad}")
        closure = _closure("PAD", at.network_id, closings, order, station_id=station_id, pad=pad)
        return await _make(closings, closure, query, response)

    @router.get(path)
    async def list_outages(
        station_id: StationId,
        pad: PadNumber,
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[ClosureQuery, Query()],
    ) -> Page[ClosureInfo]:
        """The outages of a pad that are not over."""
        return await _page(closings, caller, query, "PAD", station_id=station_id, pad=pad)

    @router.delete(f"{path}/{{closure_id}}", status_code=204)
    async def end_outage(
        station_id: StationId,
        pad: PadNumber,
        closure_id: ClosureId,
        caller: Annotated[Caller, Depends(gate)],
    ) -> None:
        """End an outage of a pad."""
        await _lift(closings, caller, closure_id, "PAD", station_id=station_id, pad=pad)


def _add_segment_closures(router: ServiceRouter, gate: ServiceGate, closings: Closings) -> None:
    path = "/v1/segments/{from_id}/{to_id}/closures"

    @router.post(path, response_model=ClosureMade, responses=_MADE)
    async def close_segment(
        from_id: StationId,
        to_id: StationId,
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[DryRun, Query()],
        response: Response,
        order: ClosureOrder | None = None,
    ) -> ClosureMade:
        """Have nobody fly a segment in this direction."""
        caller.must_be("operator")
        at = await closings.around(from_id)
        if all(segment.to_id != to_id for segment in at.network.segments_from(from_id)):
            raise NotFound("segment", f"{from_id}/{to_id}")
        closure = _closure(
            "SEGMENT", at.network_id, closings, order, station_id=from_id, to_station_id=to_id
        )
        return await _make(closings, closure, query, response)

    @router.get(path)
    async def list_segment_closures(
        from_id: StationId,
        to_id: StationId,
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[ClosureQuery, Query()],
    ) -> Page[ClosureInfo]:
        """The closures of a segment that are not over."""
        return await _page(
            closings, caller, query, "SEGMENT", station_id=from_id, to_station_id=to_id
        )

    @router.delete(f"{path}/{{closure_id}}", status_code=204)
    async def reopen_segment(
        from_id: StationId,
        to_id: StationId,
        closure_id: ClosureId,
        caller: Annotated[Caller, Depends(gate)],
    ) -> None:
        """Lift a closure of a segment."""
        await _lift(
            closings, caller, closure_id, "SEGMENT", station_id=from_id, to_station_id=to_id
        )


def _add_zones(router: ServiceRouter, gate: ServiceGate, closings: Closings) -> None:
    @router.post("/v1/zones", response_model=ClosureMade, responses=_MADE)
    async def make_zone(
        order: ZoneOrder,
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[DryRun, Query()],
        response: Response,
    ) -> ClosureMade:
        """Have nobody fly through an area, nor land in it."""
        caller.must_be("operator")
        closure = _closure("ZONE", order.network_id, closings, order, area=order.area)
        return await _make(closings, closure, query, response)

    @router.get("/v1/zones")
    async def list_zones_made(
        caller: Annotated[Caller, Depends(gate)], query: Annotated[ClosureQuery, Query()]
    ) -> Page[ClosureInfo]:
        """The zones that were made beside those of the networks, and are not over."""
        return await _page(closings, caller, query, "ZONE")

    @router.delete("/v1/zones/{closure_id}", status_code=204)
    async def lift_zone(closure_id: ClosureId, caller: Annotated[Caller, Depends(gate)]) -> None:
        """Lift a zone."""
        await _lift(closings, caller, closure_id, "ZONE")


def _add_ground_stops(router: ServiceRouter, gate: ServiceGate, closings: Closings) -> None:
    @router.post("/v1/ground-stops", response_model=ClosureMade, responses=_MADE)
    async def stop_on_ground(
        order: GroundStopOrder,
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[DryRun, Query()],
        response: Response,
    ) -> ClosureMade:
        """Have nobody take off; who flies, lands as planned."""
        caller.must_be("operator")
        closure = _closure(
            "GROUND_STOP",
            order.network_id,
            closings,
            ClosureOrder(until=order.until, reason=order.reason),
            area=order.area,
            provider_id=order.provider_id,
            drone_model_id=order.drone_model_id,
        )
        return await _make(closings, closure, query, response)

    @router.get("/v1/ground-stops")
    async def list_ground_stops(
        caller: Annotated[Caller, Depends(gate)], query: Annotated[ClosureQuery, Query()]
    ) -> Page[ClosureInfo]:
        """The ground stops that are not over."""
        return await _page(closings, caller, query, "GROUND_STOP")

    @router.delete("/v1/ground-stops/{closure_id}", status_code=204)
    async def lift_ground_stop(
        closure_id: ClosureId, caller: Annotated[Caller, Depends(gate)]
    ) -> None:
        """Let drones take off again."""
        await _lift(closings, caller, closure_id, "GROUND_STOP")


def _closure(
    kind: ClosureKind,
    network_id: NetworkId | None,
    closings: Closings,
    order: ClosureOrder | None,
    **members: Any,  # the members of Closure that this kind has
) -> Closure:
    order = order or ClosureOrder()
    from_ms, until_ms = order.span_ms(closings.now_ms)
    return Closure(
        closure_id=_NOT_MADE,
        kind=kind,
        network_id=network_id,
        from_ms=from_ms,
        made_ms=closings.now_ms,
        until_ms=until_ms,
        reason=order.reason,
        **members,
    )


async def _make(
    closings: Closings, closure: Closure, query: DryRun, response: Response
) -> ClosureMade:
    if query.dry_run:
        affected = await closings.preview(closure)
    else:
        closure, affected = await closings.make(closure)
        response.status_code = 201
    return made(closure, affected)


async def _page(
    closings: Closings,
    caller: Caller,
    query: ClosureQuery,
    kind: ClosureKind,
    *,
    station_id: StationId | None = None,
    pad: int | None = None,
    to_station_id: StationId | None = None,
) -> Page[ClosureInfo]:
    caller.must_be("customer", "provider", "operator", "service")
    if station_id is not None:
        await closings.around(station_id)
    after = query.after(str)
    shown_ones = ClosureFilter(
        kind=kind,
        lasting_beyond_ms=None if query.all else closings.now_ms,
        station_id=station_id,
        pad=pad,
        to_station_id=to_station_id,
    )
    async with closings.db.read() as connection:
        rows = await store.page(
            connection, shown_ones, after=str(after[0]) if after else "", limit=query.limit + 1
        )
    return page_of(rows, query, item=shown, sort_key=lambda row: (row.closure_id,))


async def _lift(
    closings: Closings,
    caller: Caller,
    closure_id: ClosureId,
    kind: ClosureKind,
    *,
    station_id: StationId | None = None,
    pad: int | None = None,
    to_station_id: StationId | None = None,
) -> None:
    caller.must_be("operator")
    async with closings.db.read() as connection:
        closure = await store.get(connection, closure_id)
    asked = (kind, station_id, pad, to_station_id)
    if closure is None or asked != (
        closure.kind,
        closure.station_id,
        closure.pad,
        closure.to_station_id,
    ):
        raise NotFound("closure", closure_id)
    await closings.lift(closure)
