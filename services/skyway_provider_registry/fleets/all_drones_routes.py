"""The drones of all providers over REST, for operators."""

from typing import Annotated

from fastapi import Depends, Query
from pydantic import Field

from skyway.ids import ProviderId
from skyway.runtime.clock import FleetClock
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.paging import Page, PageQuery, page_of
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.sql.database import Database
from skyway_provider_registry.fleets import all_drones_store
from skyway_provider_registry.fleets.drone import Drone, DroneStateName


class DroneListQuery(PageQuery):
    """Which drones a list shows."""

    state: Annotated[DroneStateName | None, Field(description="Only drones in this state.")] = None
    provider_id: Annotated[
        ProviderId | None, Field(description="Only drones of this provider.")
    ] = None


def all_drones_routes(*, db: Database, gate: ServiceGate, clock: FleetClock) -> ServiceRouter:
    """GET /v1/drones."""
    router = ServiceRouter(tags=("drones",))

    @router.get("/v1/drones")
    async def list_all_drones(
        caller: Annotated[Caller, Depends(gate)], query: Annotated[DroneListQuery, Query()]
    ) -> Page[Drone]:
        """List the drones of all providers, by id."""
        caller.must_be("operator")
        async with db.read() as connection:
            drones = await all_drones_store.page(
                connection,
                query,
                provider_id=query.provider_id,
                state=query.state,
                wall_now=clock.wall_now(),
            )
        return page_of(
            drones, query, item=lambda drone: drone, sort_key=lambda drone: (drone.drone_id,)
        )

    return router
