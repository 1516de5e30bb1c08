"""The drones of all providers over REST: for operators, the live picture and quotas."""

from typing import Annotated

from fastapi import Depends, Query, Response
from pydantic import Field

from skyway.contracts.drones import DroneQuota
from skyway.contracts.live import LIVE_DRONES, LiveDrones
from skyway.ids import ProviderId
from skyway.runtime.http.identity import Caller
from skyway.runtime.http.paging import Page, PageQuery, page_of
from skyway.runtime.http.service_router import ServiceRouter
from skyway_provider_registry.context import Context
from skyway_provider_registry.fleets import store
from skyway_provider_registry.fleets.drone import Drone, DroneStateName
from skyway_provider_registry.fleets.live_store import Mark, live_drones
from skyway_provider_registry.fleets.quota_store import DroneLimit


class DroneListQuery(PageQuery):
    """Which drones a list shows."""

    state: Annotated[DroneStateName | None, Field(description="Only drones in this state.")] = None
    provider_id: Annotated[
        ProviderId | None, Field(description="Only drones of this provider.")
    ] = None


def all_drones_routes(context: Context) -> ServiceRouter:
    """GET /v1/drones."""
    router = ServiceRouter(tags=("drones",))

    @router.get("/v1/drones")
    async def list_all_drones(
        caller: Annotated[Caller, Depends(context.gate)], query: Annotated[DroneListQuery, Query()]
    ) -> Page[Drone]:
        """List the drones of all providers, by id."""
        caller.must_be("operator")
        async with context.db.read() as connection:
            drones = await store.page(
                connection,
                query,
                provider_id=query.provider_id,
                state=query.state,
                wall_now=context.clock.wall_now(),
            )
        return page_of(
            drones, query, item=lambda drone: drone, sort_key=lambda drone: (drone.drone_id,)
        )

    return router


def live_routes(context: Context) -> ServiceRouter:
    """GET /internal/live/drones."""
    router = ServiceRouter(tags=("internal",))

    @router.get(LIVE_DRONES, response_model=LiveDrones)
    async def list_live_drones(
        caller: Annotated[Caller, Depends(context.gate)],
        since: Annotated[
            str | None,
            Query(max_length=64, description="The `mark` of an earlier answer; without it all."),
        ] = None,
    ) -> Response:
        """The drones that have changed since the mark of an earlier answer; all without one."""
        caller.must_be_service("gateway")
        mark = None if since is None else Mark.parse(since)
        async with context.db.read() as connection:
            found = await live_drones(connection, mark, wall_now=context.clock.wall_now())
        # Serialized here: the answer is valid, and FastAPI would validate each drone again.
        return Response(found.model_dump_json(exclude_defaults=True), media_type="application/json")

    return router


def quota_routes(context: Context, *, limit: DroneLimit) -> ServiceRouter:
    """GET /internal/providers/{provider_id}/drone-quota."""
    router = ServiceRouter(tags=("internal",))

    @router.get("/internal/providers/{provider_id}/drone-quota")
    async def get_drone_quota(
        provider_id: ProviderId, caller: Annotated[Caller, Depends(context.gate)]
    ) -> DroneQuota:
        """How many drones a provider may have, and has."""
        caller.must_be_service("gateway")
        return await limit.quota(provider_id)

    return router
