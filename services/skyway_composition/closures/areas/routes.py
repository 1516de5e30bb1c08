"""Zones and ground stops over REST."""

from typing import Annotated

from fastapi import Depends, Query, Response

from skyway.ids import ClosureId
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.paging import Page
from skyway.runtime.http.service_router import ServiceRouter
from skyway_composition.closures.closing import Closings
from skyway_composition.closures.desk import (
    MADE,
    closure_of,
    lift,
    made_or_shown,
    page_of_kind,
    status_of,
)
from skyway_composition.closures.orders import (
    ClosureInfo,
    ClosureMade,
    ClosureOrder,
    ClosureQuery,
    DryRun,
    GroundStopOrder,
    ZoneOrder,
)


def area_routes(*, gate: ServiceGate, closings: Closings) -> ServiceRouter:
    """Zones, and ground stops in an area, in a network or everywhere."""
    router = ServiceRouter(tags=("closures",))
    _add_zones(router, gate, closings)
    _add_ground_stops(router, gate, closings)
    return router


def _add_zones(router: ServiceRouter, gate: ServiceGate, closings: Closings) -> None:
    @router.post("/v1/zones", response_model=ClosureMade, responses=MADE)
    async def make_zone(
        order: ZoneOrder,
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[DryRun, Query()],
        response: Response,
    ) -> ClosureMade:
        """Have nobody fly through an area, nor land in it."""
        caller.must_be("operator")
        closure = closure_of("ZONE", order.network_id, closings, order, area=order.area)
        response.status_code = status_of(query)
        return await made_or_shown(closings, closure, query)

    @router.get("/v1/zones")
    async def list_zones_made(
        caller: Annotated[Caller, Depends(gate)], query: Annotated[ClosureQuery, Query()]
    ) -> Page[ClosureInfo]:
        """The zones that were made beside those of the networks, and are not over."""
        return await page_of_kind(closings, caller, query, "ZONE")

    @router.delete("/v1/zones/{closure_id}", status_code=204)
    async def lift_zone(closure_id: ClosureId, caller: Annotated[Caller, Depends(gate)]) -> None:
        """Lift a zone."""
        await lift(closings, caller, closure_id, "ZONE")


def _add_ground_stops(router: ServiceRouter, gate: ServiceGate, closings: Closings) -> None:
    @router.post("/v1/ground-stops", response_model=ClosureMade, responses=MADE)
    async def stop_on_ground(
        order: GroundStopOrder,
        caller: Annotated[Caller, Depends(gate)],
        query: Annotated[DryRun, Query()],
        response: Response,
    ) -> ClosureMade:
        """Have nobody take off; who flies, lands as planned."""
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
        return await made_or_shown(closings, closure, query)

    @router.get("/v1/ground-stops")
    async def list_ground_stops(
        caller: Annotated[Caller, Depends(gate)], query: Annotated[ClosureQuery, Query()]
    ) -> Page[ClosureInfo]:
        """The ground stops that are not over."""
        return await page_of_kind(closings, caller, query, "GROUND_STOP")

    @router.delete("/v1/ground-stops/{closure_id}", status_code=204)
    async def lift_ground_stop(
        closure_id: ClosureId, caller: Annotated[Caller, Depends(gate)]
    ) -> None:
        """Let drones take off again."""
        await lift(closings, caller, closure_id, "GROUND_STOP")
