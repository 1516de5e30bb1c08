"""The gateway reads the drones for its live picture."""

from typing import Annotated

from fastapi import Depends, Query, Response

from skyway.contracts.live import LIVE_DRONES, LiveDrones
from skyway.runtime.clock import FleetClock
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.sql.database import Database
from skyway_provider_registry.fleets.live_store import Mark, live_drones


def live_routes(*, db: Database, gate: ServiceGate, clock: FleetClock) -> ServiceRouter:
    """GET /internal/live/drones."""
    router = ServiceRouter(tags=("internal",))

    @router.get(LIVE_DRONES, response_model=LiveDrones)
    async def list_live_drones(
        caller: Annotated[Caller, Depends(gate)],
        since: Annotated[
            str | None,
            Query(max_length=64, description="The `mark` of an earlier answer; without it all."),
        ] = None,
    ) -> Response:
        """The drones that have changed since the mark of an earlier answer; all without one."""
        caller.must_be_service("gateway")
        mark = None if since is None else Mark.parse(since)
        async with db.read() as connection:
            found = await live_drones(connection, mark, wall_now=clock.wall_now())
        # Serialized here: the answer is valid, and FastAPI would validate each drone again.
        return Response(found.model_dump_json(exclude_defaults=True), media_type="application/json")

    return router
